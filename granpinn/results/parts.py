"""The record of the friction law on parts of the data (uncertainty/of_parts.py)."""

from __future__ import annotations

from dataclasses import dataclass

from granpinn.results.named import require_names

# Of every split: its two parts, in words that follow "than".
SPLITS = {
    "time": ("early times", "late times"),
    "rate": ("slow grains", "fast grains"),
    "height": ("grains near the floor", "grains near the surface"),
    "side": ("grains on the left", "grains on the right"),
}


@dataclass(frozen=True)
class Part:
    """One part of the data with its own law.

    Attributes:
        name: in words.
        theta: all parameters of the law of this part, by name.
        I_low, I_high: 5th and 95th percentile of I of the part, by what its points tell of the law.
        share: of all that the data tell of the law.
    """

    name: str
    theta: dict[str, float]
    I_low: float
    I_high: float
    share: float


@dataclass(frozen=True)
class Split:
    """Two parts of the data and the difference between their laws.

    Attributes:
        name: of the split, one of `SPLITS`.
        parts: both parts.
        I: where the laws are compared: of the I that both parts hold that of the clearest
            difference, or the best known one if none is clear.
        percent: friction of the second part over that of the first one there, less 1; None: both
            hold no common I, or the laws on the parts could not be solved for.
        std_percent: its standard deviation: correlated residuals and the error of the law.
        model_percent: the part of the error of the law in flows of this kind; None: not known.
        limit_percent: a larger difference is none of chance, at the level of all splits together;
            None: `model_percent` is not known.
    """

    name: str
    parts: tuple[Part, Part]
    I: float | None = None  # noqa: E741 (the inertial number's own symbol)
    percent: float | None = None
    std_percent: float | None = None
    model_percent: float | None = None
    limit_percent: float | None = None

    def __post_init__(self) -> None:
        if self.name not in SPLITS:
            raise ValueError(f"name must be one of {', '.join(SPLITS)}, got {self.name!r}")
        known = {value is None for value in (self.I, self.percent, self.std_percent)}
        if len(known) > 1 or (known == {True} and self.limit_percent is not None):
            raise ValueError("I, percent and std_percent belong together: expected all or none")

    @property
    def differs(self) -> bool:
        """Whether the two parts need different laws."""
        if self.percent is None or self.limit_percent is None:
            return False
        return abs(self.percent) > self.limit_percent

    def __str__(self) -> str:
        """What the parts need, in words."""
        first, second = (part.name for part in self.parts)
        if self.percent is None:
            return f"{first} and {second} hold no common I"
        ratio = 1 + self.percent / 100
        more, less = (second, first) if ratio >= 1 else (first, second)
        excess = 100 * (max(ratio, 1 / ratio) - 1)
        return (
            f"{more} need {excess:.2g} % more friction than {less} (+- {self.std_percent:.2g} %, "
            f"at I = {self.I:.2g})"
        )


@dataclass(frozen=True)
class Parts:
    """The law on parts of the data.

    Attributes:
        level: probability that any split of data of one law is called different.
        splits: those that the flow has.
    """

    level: float
    splits: tuple[Split, ...]

    def __post_init__(self) -> None:
        parts = [part for split in self.splits for part in split.parts]
        for part in parts[1:]:
            require_names(part.theta, tuple(parts[0].theta), where=f"theta of {part.name}: ")

    @property
    def different(self) -> tuple[Split, ...]:
        """The splits whose parts need different laws, the largest excess over its limit first."""
        found = [split for split in self.splits if split.differs]
        return tuple(sorted(found, key=lambda s: -abs(s.percent or 0) / (s.limit_percent or 1)))

    @property
    def largest_limit(self) -> float | None:
        """The largest limit of all splits, %; None without any."""
        limits = [s.limit_percent for s in self.splits if s.limit_percent is not None]
        return max(limits, default=None)

    def __str__(self) -> str:
        """The line for the terminal."""
        if self.different:
            return "no single law: " + "; ".join(str(split) for split in self.different)
        if self.largest_limit is None:
            return "parts of the data are not compared"
        limit = f"{self.largest_limit:.2g} %"
        return f"one law on all parts of the data: a difference of more than {limit} would be seen"
