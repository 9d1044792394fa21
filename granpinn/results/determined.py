"""The record of what a narrow range of inertial numbers, or a flow between walls, determines."""

from __future__ import annotations

from dataclasses import dataclass

NOT_DETERMINED = "not determined"


@dataclass(frozen=True)
class Determined:
    """What the data determine (uncertainty/determined.py).

    Attributes:
        I_low, I_high: of the points that shear, 5th and 95th percentile.
        I: their mean.
        mu, std, interval_90: friction at this I, without error bars if the law has none.
        lost: names of the parameters that are not determined. Each has `determined` = false and no
            error bars in `parameters`; those that it had are here.
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

    def __str__(self) -> str:
        """The line for the terminal, where a parameter is not determined."""
        if self.reason is not None:
            return f"{' and '.join(self.lost)} {NOT_DETERMINED}: {self.reason}"
        interval = ""
        if self.interval_90 is not None:
            low, high = self.interval_90
            interval = f" (90 % interval {low:.4f} to {high:.4f})"
        return (
            f"{' and '.join(self.lost)} {NOT_DETERMINED}: the grains shear at I = {self.I_low:.2g} "
            f"to {self.I_high:.2g} only; mu = {self.mu:.4f} at I = {self.I:.2g}{interval}"
        )
