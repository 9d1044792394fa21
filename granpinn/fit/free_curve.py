"""The free curve of a training over the range of I of a result, and its band.

The error of a free curve is known from simulated flows of known laws (uncertainty/curve_error.py).
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from granpinn.arrays import Float64
from granpinn.errors import CannotGoOn
from granpinn.fit.case import Case
from granpinn.physics.laws import free
from granpinn.results import Result
from granpinn.results.records import Curve
from granpinn.training.information import information
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty import error_model
from granpinn.uncertainty.curve_error import (
    CurveBand,
    Quadratic,
    basis,
    model_covariance,
    quadratic,
)
from granpinn.uncertainty.determined import POINTS
from granpinn.uncertainty.error_bars import known_of, untested

LARGEST = 1.0  # of mu: beyond it no law can be excluded
TOLD_APART = 0.95  # of the errors of a free curve: laws that differ by more are told apart
LEAST = 1e-3  # of mu, beside its covariance: no curve is known better


class NoFreeCurveError(CannotGoOn):
    """The free curve, or its error, is not known; the message is one sentence."""


def with_free_band(result: Result, case: Case, run: TrainingLoop, place: int) -> Result:
    """The result with the band of its curve, if its law is the free curve.

    Args:
        place: of its member in the run.
    """
    curve = result.law.curve
    if result.law.name != free.LAW.name or curve is None:
        return result
    try:
        band = FreeCurve(result, case, run, place).band()
    except NoFreeCurveError as error:
        law = dataclasses.replace(result.law, reason=str(error))
        return dataclasses.replace(result, law=law)
    ends = ((band.mu - band.half).tolist(), (band.mu + band.half).tolist())
    wide = Curve(curve.I, tuple(band.mu.tolist()), *(tuple(end) for end in ends))
    law = dataclasses.replace(result.law, curve=wide, reason=None)
    return dataclasses.replace(result, law=law)


class FreeCurve:
    """The free curve of a run over the range of I of a result."""

    def __init__(self, result: Result, case: Case, run: TrainingLoop, place: int) -> None:
        if changed := untested(case.config):
            raise NoFreeCurveError(
                "the error of a free curve is that of the default recipe, and this run has "
                f"another {', '.join(changed)}"
            )
        if result.law.I_range is None or result.residuals is None:
            raise NoFreeCurveError("the range of I of the data is not known")
        if result.law.I_range[0] >= result.law.I_range[1]:
            raise NoFreeCurveError("the data hold one I alone, which any law explains")
        known = quadratic_of(run, place, len(free.LAW.curve))
        if known is None:
            raise NoFreeCurveError("the training with a free curve did not end with its last layer")
        self.known: Quadratic = known
        theta = run.trainer.solution(place)[1].tolist()
        self.ends = theta[-2], theta[-1]
        self.model, self.I_range = error_model.load(), result.law.I_range
        x = error_model.ends_of(self.I_range, case.config.I0)
        mu = basis(np.array(self.I_range), *self.ends) @ known.center
        if not (mu > 0).all():
            raise NoFreeCurveError("the free curve is not positive over the range of I of the data")
        mu_s, mu_2 = np.linalg.solve(error_model.line(x), mu).tolist()
        of_run = known_of(result, x, (mu_s, mu_2), real=not case.flow.of_solver)
        method, grains = self.model.method(of_run), self.model.grains(of_run)
        self.of_ends: Float64 = self.model.free_curve**2 * method + grains
        usual = math.exp(self.model.lower["constant"])
        self.scale = max(1.0, float(self.model.sd(of_run)[0]) / usual)

    def covariance(self, I: Float64) -> Float64:
        """Covariance of mu at every I [n, n]."""
        B = basis(I, *self.ends)
        mu = B @ self.known.center
        own = B @ self.known.covariance @ B.T
        model = model_covariance(I, mu, self.I_range, self.of_ends)
        return own + model + np.diag((LEAST * mu) ** 2)

    def band(self) -> CurveBand:
        """The curve with its errors over the range of I."""
        I = np.geomspace(*self.I_range, POINTS)
        mu = basis(I, *self.ends) @ self.known.center
        std = np.sqrt(np.diag(self.covariance(I)))
        farthest = self.model.half_width(TOLD_APART) * std
        if (farthest > LARGEST * mu).any():
            raise NoFreeCurveError(
                "so few steps, or so large a misfit of the velocity, leave a free curve whose "
                "error is as large as the friction"
            )
        return CurveBand(I, mu, self.model.half_width() * std, farthest)


def quadratic_of(run: TrainingLoop, place: int, L: int) -> Quadratic | None:
    """The loss around the first L free parameters of a member."""
    ended = run.trainer.ended(place)
    found = information(*ended) if ended else None
    return None if found is None else quadratic(found, L)
