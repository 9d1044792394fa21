"""The record of what a flow determines.

A narrow range of inertial numbers, a short training, noise, or walls that carry the grains can
leave parameters that are not determined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

NOT_DETERMINED = "not determined"
USELESS = 0.5  # half of a 90 % interval, of the logarithm: beyond, the value is not determined


def half_width(interval: tuple[float, float]) -> float:
    """Half of an interval, of the logarithm."""
    low, high = interval
    return math.log(high / low) / 2 if low > 0 else math.inf


def spans(half: float) -> str:
    """Why a value with an interval of this half width is not determined."""
    return f"its 90 % interval spans a factor of {math.exp(2 * half):.2g}"


@dataclass(frozen=True)
class Determined:
    """What the data determine (uncertainty/determined.py).

    Attributes:
        I_low, I_high: of the points that shear, 5th and 95th percentile.
        I: their mean.
        mu, std, interval_90: friction at this I, without error bars if the law has none.
        lost: names of the parameters that are not determined. Each has `determined` = false and no
            error bars in `parameters`; those that it had are here.
        wide: those of `lost` whose 90 % interval is wider than `USELESS`.
        raw_std, raw_interval_90: of the parameters in `lost` that had them.
        reason: why no friction at any I is determined, in words (estimates/confined.py); `mu` is
            then that of the training, without a meaning. None: `mu` is determined.
    """

    I_low: float
    I_high: float
    I: float
    mu: float
    std: float | None
    interval_90: tuple[float, float] | None
    lost: tuple[str, ...] = ()
    raw_std: dict[str, float] | None = None
    raw_interval_90: dict[str, tuple[float, float]] | None = None
    reason: str | None = None
    wide: tuple[str, ...] = ()

    def why(self, name: str) -> str:
        """Why a parameter in `lost` is not determined."""
        if self.reason is not None:
            return self.reason
        if name in self.wide and self.raw_interval_90 is not None:
            return spans(half_width(self.raw_interval_90[name]))
        return f"the grains shear at I = {self.I_low:.2g} to {self.I_high:.2g} only"

    def __str__(self) -> str:
        """The line for the terminal, where a parameter is not determined."""
        names: dict[str, list[str]] = {}
        for name in self.lost:
            names.setdefault(self.why(name), []).append(name)
        text = "; ".join(f"{' and '.join(n)} {NOT_DETERMINED}: {why}" for why, n in names.items())
        if self.reason is not None:
            return text
        interval = ""
        if self.interval_90 is not None:
            low, high = self.interval_90
            interval = f" (90 % interval {low:.4f} to {high:.4f})"
        return f"{text}; mu = {self.mu:.4f} at I = {self.I:.2g}{interval}"
