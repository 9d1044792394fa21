"""The record of the momentum balance, which needs no network."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    """Friction mu in a bin of I, with its standard error, from so many cells."""

    I: float
    mu: float
    se: float
    cells: int


@dataclass(frozen=True)
class LawFit:
    """mu(I) = mu_s + (mu_2 - mu_s) I/(I + I0) through the points, with standard deviations."""

    mu_s: float
    mu_2: float
    I0: float
    mu_s_sd: float
    mu_2_sd: float


@dataclass(frozen=True)
class Baseline:
    """What the momentum balance alone says about the friction (inspection/baseline.py).

    Attributes:
        reason: why the balance does not apply, in words; None if it applies.
        carried: whether that is because more than the base carries the grains.
        points: in bins of I between its 5th and 95th percentile.
        mean: of all cells in this range.
        law: None where the range is narrow or fewer than three bins are filled.
        window: cells on each side of the local fits.
        parts: relative standard errors of `mean` by their sources.
        wall_friction: friction of the side walls that it counts; None without `wall_gap`.
    """

    reason: str | None = None
    points: tuple[Point, ...] = ()
    mean: Point | None = None
    law: LawFit | None = None
    window: int | None = None
    parts: dict[str, float] | None = None
    carried: bool = False
    wall_friction: float | None = None

    @property
    def I_range(self) -> tuple[float, float] | None:
        """I of the first and the last point."""
        return (self.points[0].I, self.points[-1].I) if self.points else None

    @property
    def shown(self) -> tuple[Point, ...]:
        """The first point, the mean and the last point; the mean alone in a narrow range."""
        if self.reason is not None or self.mean is None:
            return ()
        if len(self.points) < 3:
            return (self.mean,)
        return (self.points[0], self.mean, self.points[-1])

    @property
    def sentence(self) -> str:
        """The friction in a sentence, without the network."""
        if not self.shown:
            return f"The momentum balance alone, without a network, does not apply: {self.reason}."
        text = ", ".join(f"{p.mu:.3f} +- {p.se:.3f} at I = {p.I:.2g}" for p in self.shown)
        return f"The momentum balance alone, without a network, gives mu = {text}{self._walls}."

    @property
    def _walls(self) -> str:
        friction = self.wall_friction
        return "" if friction is None else f", with the friction {friction:g} of the side walls"

    def __str__(self) -> str:
        """The line for the terminal."""
        if not self.shown:
            return f"momentum balance, no network: it does not apply: {self.reason}"
        values = ", ".join(f"{p.mu:.3f} +- {p.se:.3f} at I = {p.I:.2g}" for p in self.shown)
        return f"momentum balance, no network: mu = {values}{self._walls}"
