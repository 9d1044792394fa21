"""The table behind the error bars: the errors of identifications of simulated mu(I) collapses.

`python -m bench.studies.coverage.calibrate` makes calibration.json in this folder; `provenance`
names its trainings. All covariances are of z = (error of mu_s, error of mu_2) / mu_s. In this unit
the scatter along the valley between mu_s and mu_2 is the same for every material, while the
relative error of mu_2 grows as mu_2 / mu_s falls (bench/studies/coverage).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from granpinn.arrays import Float64
from granpinn.physics import terms
from granpinn.results.decoding import decode
from granpinn.results.named import require_names
from granpinn.uncertainty.held import NoiseError, ReachError
from granpinn.uncertainty.misfit_growth import MisfitGrowth

PATH = Path(__file__).with_suffix(".json")
# The table of a level. A level without a file has no data, hence no error bars.
PATHS = {"V0": PATH.with_name("calibration_V0.json"), "V1": PATH, "V2": PATH}
# Kinds of flows with a model error, as they continue "flows of grains ...".
KINDS = {
    "collapse": "that collapse",
    "layer": "that are the same along x",
    "steady_layer": "that are steady and the same along x",
    "steady": "that are steady",
    "carried": "that walls carry",
}

Matrix = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Range:
    """Residual of flows of the law: rms = 10^intercept misfit^slope, rarely `limit` times that."""

    intercept: float
    slope: float
    limit: float

    def ratio(self, rms: float, misfit: float) -> float:
        """`rms` relative to that of flows of the law at this misfit of the velocity."""
        return float(rms / (10**self.intercept * misfit**self.slope))

    def misfit(self, rms: float) -> float:
        """The misfit at which flows of the law have this residual."""
        return float((rms / 10**self.intercept) ** (1 / self.slope))


@dataclass(frozen=True)
class ModelError:
    """How wrong mu(I) was in flows of grains of one kind (of_kind.py).

    Attributes:
        level: rms relative error of mu in the middle of the range of I of a flow.
        tilt: rms half of the difference between the relative errors at both ends of that range.
        flows: number of flows behind both.
        provenance: the flows, and the trainings that gave the numbers.
    """

    level: float
    tilt: float
    flows: float
    provenance: str

    def __post_init__(self) -> None:
        for name in ("level", "tilt"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must be from 0 to 1, got {getattr(self, name)}")
        if not self.flows >= 1 or not math.isfinite(self.flows):
            raise ValueError(f"flows must be at least 1, got {self.flows}")


@dataclass(frozen=True)
class FreeCurveError:
    """How wrong free curves were in simulated collapses of several laws (free_curve.py).

    Attributes:
        modes: rms of the parts of the relative error of mu: level, tilt, curvature, ... , the
            Legendre polynomials over the range of I of a flow.
        widening, farthest: half-widths of the bands that hold all of 90 % and of 99 % of the
            curves, over the standard deviation.
        cohesion: rms cohesion that was found in grains without any, over rho |g| H.
        cohesion_percent: rms relative error of the cohesion of cohesive grains.
        noise: largest noise of the vectors over the rms speed.
        steps: of the shortest trainings that were no worse.
        flows: number of flows behind them.
        provenance: the trainings that gave the numbers.
    """

    modes: tuple[float, ...]
    widening: float
    farthest: float
    cohesion: float
    cohesion_percent: float
    noise: float
    steps: int
    flows: int
    provenance: str

    def growth(self, noise: float) -> float:
        """Factor on all errors beyond the noise of these flows: they grow in proportion."""
        return max(1.0, noise / self.noise)


@dataclass(frozen=True)
class ShortTraining:
    """How wrong shorter trainings of such flows were.

    Attributes:
        steps: of the trainings.
        discrepancy: as that of the table, at its knots; it holds what its widening lacks.
        flows: number of flows behind it.
        provenance: the trainings that gave the numbers.
    """

    steps: int
    discrepancy: tuple[Matrix, ...]
    flows: int
    provenance: str


@dataclass(frozen=True)
class Calibration:
    """
    Attributes:
        law: name of the friction law of the study; other laws have no error bars.
        provenance: the trainings that gave the numbers.
        provisional: whether a coverage study has still to confirm the numbers.
        scatter: covariance of z of one member over seeds.
        scatter_weight: number of members of an ensemble with the same weight as this covariance.
        mu_s: knots of the discrepancy, ascending.
        discrepancy: second moment of z at these knots, beyond the scatter.
        discrepancy_weight: number of truths behind each.
        misfit: largest relative velocity misfit in the study; errors grow with it from there.
        steps: of the shortest trainings in the study.
        noise_part: velocity error of the fit, as a part of the measurement noise.
        widening: factors on the 90 % intervals of mu_s and mu_2, as errors are not quite normal.
        residuals: of the equations, by terms of the loss.
        valid_mu_s, valid_ratio: mu_s and mu_2 / mu_s of the materials in the study.
        largest_misfit: the residuals can test the law up to this misfit.
        model_error: of flows of grains, by their kind (`KINDS`); a kind without data is absent.
        free_curve: error of the law `free`; None: not calibrated.
        shorter: studies of shorter trainings, from few steps to many.
        reach: errors in flows that reach other I; None: not calibrated.
        noise: errors that noise adds; None: not calibrated.
        growth: of errors with a misfit beyond that of the study; None: in proportion.
    """

    law: str
    provenance: str
    provisional: bool
    scatter: Matrix
    scatter_weight: float
    mu_s: tuple[float, ...]
    discrepancy: tuple[Matrix, ...]
    discrepancy_weight: float
    misfit: float
    steps: int
    noise_part: float
    widening: tuple[float, float]
    residuals: dict[str, Range]
    valid_mu_s: tuple[float, float]
    valid_ratio: tuple[float, float]
    largest_misfit: float
    model_error: dict[str, ModelError] = field(default_factory=dict)
    free_curve: FreeCurveError | None = None
    shorter: tuple[ShortTraining, ...] = ()
    reach: ReachError | None = None
    noise: NoiseError | None = None
    growth: MisfitGrowth | None = None

    def __post_init__(self) -> None:
        require_names(self.residuals, (), terms.NAMES, "residuals.")
        require_names(self.model_error, (), tuple(KINDS), "model_error.")
        steps = [s.steps for s in self.lengths]
        if min(steps) < 1 or steps != sorted(set(steps)):
            raise ValueError(f"the steps of shorter and of the table must ascend, got {steps}")
        for length in self.lengths:
            if len(self.mu_s) != len(length.discrepancy) or not self.mu_s:
                raise ValueError(
                    f"discrepancy must have one matrix for each of {len(self.mu_s)} knots mu_s, "
                    f"got {len(length.discrepancy)}"
                )
        for matrix in (self.scatter, *(m for s in self.lengths for m in s.discrepancy)):
            if matrix[0][1] != matrix[1][0] or min(np.linalg.eigvalsh(matrix)) < -1e-12:
                raise ValueError(f"a covariance must be symmetric and not negative, got {matrix}")

    @property
    def lengths(self) -> tuple[ShortTraining, ...]:
        """The studies by their steps, from few to many; the table's own is the last."""
        flows = round(self.discrepancy_weight)
        return *self.shorter, ShortTraining(self.steps, self.discrepancy, flows, self.provenance)

    def discrepancy_at(self, mu_s: float, steps: int) -> Float64:
        """Second moment [2, 2] of z after so many steps.

        Linear in mu_s between the knots and in log(steps) between the studies, constant beyond.
        """
        lengths = self.lengths
        found = [_between(mu_s, self.mu_s, np.array(s.discrepancy)) for s in lengths]
        at = [math.log(s.steps) for s in lengths]
        return _between(math.log(max(1, steps)), at, np.array(found))


def _between(x: float, knots: Sequence[float], values: Float64) -> Float64:
    """Linear interpolation of matrices [K, 2, 2] at ascending knots, constant beyond them."""
    flat = [np.interp(x, knots, values[:, i, j]) for i in range(2) for j in range(2)]
    return np.reshape(flat, (2, 2))


@cache
def load(path: Path = PATH) -> Calibration:
    """The table; ValueError names the error in a file."""
    return decode(Calibration, json.loads(path.read_text(encoding="utf-8")))


def of_level(level: str) -> Calibration | None:
    """The table of a level, None without data; ValueError names the error in a file."""
    return load(PATHS[level]) if PATHS[level].exists() else None
