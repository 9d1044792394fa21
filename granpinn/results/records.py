"""What results.json holds beside the values: the ensemble, what the fit leaves, and the verdict."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Members:
    """The members of an ensemble that ended well, in their order.

    Attributes:
        seed, mu_s, mu_2: of each.
        redrawn: whether its data have the known noise once more (bench/studies/coverage).
        shown: index here of the member that is nearest to the center; fields are its.
        lost: how many diverged.
    """

    seed: tuple[int, ...]
    mu_s: tuple[float, ...]
    mu_2: tuple[float, ...]
    redrawn: tuple[bool, ...]
    shown: int = 0
    lost: int = 0

    def __post_init__(self) -> None:
        lengths = {len(self.seed), len(self.mu_s), len(self.mu_2), len(self.redrawn)}
        if lengths != {len(self.seed)} or not self.seed:
            raise ValueError(f"members must have one value each, got {sorted(lengths)}")
        if not 0 <= self.shown < len(self.seed):
            raise ValueError(f"shown must be one of {len(self.seed)} members, got {self.shown}")


@dataclass(frozen=True)
class Residuals:
    """Root mean squares of what a trained network leaves, over many points, dimensionless.

    Attributes:
        velocity: misfit of the data that were fitted, relative to their root mean square.
        noise: known measurement noise in these data, in the same unit; 0 where none is known.
        surface: pressure on the free surface.
        momentum: in units of rho |g|.
        continuity, constitutive: strain rates.
    """

    velocity: float
    noise: float
    surface: float
    momentum: float
    continuity: float
    constitutive: float


@dataclass(frozen=True)
class Verdict:
    """Whether the data follow the law at all; `follows` is None where this cannot be told.

    `momentum` and `constitutive` are the residuals as multiples of what data of this law leave.
    """

    follows: bool | None
    words: str
    momentum: float | None = None
    constitutive: float | None = None


@dataclass(frozen=True)
class ErrorBars:
    """What the standard deviations of (mu_s, mu_2) consist of.

    Attributes:
        scatter: sd that comes from seeds and measurement noise.
        discrepancy: sd of what simulated collapses show beyond that, scaled by the misfit.
        freedom: degrees of freedom behind the intervals.
        half_width: of the 90 % intervals, in standard deviations.
        provenance: where the calibration comes from.
        provisional: no coverage study has confirmed the calibration yet.
    """

    scatter: tuple[float, float]
    discrepancy: tuple[float, float]
    freedom: tuple[float, float]
    half_width: tuple[float, float]
    provenance: str
    provisional: bool


@dataclass(frozen=True)
class ErrorPercent:
    """Relative errors in %: of a scalar |value - true| / |true|, of a field eq. (errorL2).

    Those of the closed pressure are over the frames at which it was closed.
    """

    mu_s: float | None = None
    mu_2: float | None = None
    velocity: float | None = None
    pressure: float | None = None
    pressure_flowing: float | None = None
    pressure_stagnant: float | None = None
    pressure_simulated: float | None = None
    pressure_simulated_flowing: float | None = None
    pressure_simulated_stagnant: float | None = None


@dataclass(frozen=True)
class Zones:
    """How the test points were split into flowing and stagnant (identification/scoring.py)."""

    d2_threshold: float
    source: str
    n_flowing: int
    n_stagnant: int
