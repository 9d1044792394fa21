"""The record of the identified law: its curve over the I of the data, and the points behind it."""

from __future__ import annotations

from dataclasses import dataclass

from granpinn.physics.laws import DEFAULT, LAWS
from granpinn.results.parameters import NOT_DETERMINED, USELESS, half_width

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class Curve:
    """mu over I, evenly in log I; [n] each.

    Attributes:
        I: inertial numbers.
        mu: friction of the identified law.
        low, high: its pointwise 90 % band; None where it is not determined.
    """

    I: Numbers
    mu: Numbers
    low: Numbers | None = None
    high: Numbers | None = None

    def band(self, k: int) -> str:
        """mu and its band at the point k, in words."""
        if self.low is None or self.high is None:
            return f"{self.mu[k]:.3f}"
        if not self.determines(k):
            return NOT_DETERMINED
        return f"{self.mu[k]:.3f} ({self.low[k]:.3f} to {self.high[k]:.3f})"

    def determines(self, k: int) -> bool:
        """Whether the band at the point k, if there is one, is narrow enough to mean something."""
        if self.low is None or self.high is None:
            return True
        return half_width((self.low[k], self.high[k])) <= USELESS

    @property
    def half_width(self) -> float | None:
        """Half of the band at its widest place."""
        if self.low is None or self.high is None:
            return None
        return max(high - low for low, high in zip(self.low, self.high, strict=True)) / 2


@dataclass(frozen=True)
class StressPoints:
    """|tau|/p in the fields of the fit over I, where grains shear, in bins of log I; [n] each.

    Attributes:
        I: median of the inertial numbers of a bin.
        mu, low, high: median, 16th and 84th percentile of |tau|/p.
        count: of the points of a bin.
    """

    I: Numbers
    mu: Numbers
    low: Numbers
    high: Numbers
    count: tuple[int, ...]


@dataclass(frozen=True)
class IdentifiedLaw:
    """The identified law over the inertial numbers that the data hold (uncertainty/determined.py).

    Attributes:
        name: of the law (`granpinn.physics.laws.LAWS`).
        I_range: 5th and 95th percentile of I over the points that shear; None without any.
        curve: of the law over `I_range`, and nothing beyond; None where it is not determined.
        points: |tau|/p of the fit.
        reason: why the curve, or its band, is not determined, in words; None if it has both.
    """

    name: str = DEFAULT.name
    I_range: tuple[float, float] | None = None
    curve: Curve | None = None
    points: StressPoints | None = None
    reason: str | None = None

    def __str__(self) -> str:
        """The line for the terminal."""
        if self.I_range is None:
            return f"{LAWS[self.name].title}: the range of I is {NOT_DETERMINED}: {self.reason}"
        low, high = self.I_range
        text = f"{LAWS[self.name].title} over I = {low:.2g} to {high:.2g}: "
        if self.curve is None:
            return text + f"{NOT_DETERMINED}: {self.reason}"
        text += f"mu = {self.curve.band(0)} to {self.curve.band(-1)}"
        if self.curve.low is None:
            return f"{text}, 90 % band {NOT_DETERMINED}"
        return f"{text}, with the 90 % band"
