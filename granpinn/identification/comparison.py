"""The comparison of friction laws: members of a run with other laws, and what they tell.

A free curve and the law with cohesion are trained beside the law of the settings, on the same data.
All other laws are held against the free curve (uncertainty/law_choice.py).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Config, ConfigError
from granpinn.errors import CannotGoOn
from granpinn.identification import conclusion
from granpinn.identification.case import Case, fixed_values
from granpinn.physics.laws import LAWS, cohesive, free
from granpinn.results import Parameter, Parameters, Result
from granpinn.results.identified_law import Curve
from granpinn.training.information import information
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty import error_model, law_choice
from granpinn.uncertainty.curve import POINTS
from granpinn.uncertainty.free_curve import Quadratic, basis, model_covariance, quadratic
from granpinn.uncertainty.law_choice import Band, Cohesion
from granpinn.uncertainty.of_training import untested

COMPANIONS = (free.LAW.name, cohesive.LAW.name)
LARGEST = 1.0  # of mu: beyond it no law can be excluded
TOLD_APART = 0.95  # of the errors of a free curve: laws that differ by more are told apart
LEAST = 1e-3  # of mu, beside its covariance: no curve is known better


class ComparisonError(CannotGoOn):
    """Laws cannot be compared; the message is one sentence."""


def companions(case: Case) -> list[Case]:
    """Members with the data of a case and the other laws that a comparison needs, if it is asked
    for.

    Raises:
        ConfigError: the settings hold for one law alone.
    """
    config = case.config
    if not config.compare_laws:
        return []
    if not LAWS[config.law].compiled:
        raise ConfigError(
            f"--compare-laws compares the laws of granpinn, got your own law {config.law}: leave "
            "--compare-laws out"
        )
    if config.rheology.start is not None:
        raise ConfigError(
            "--rheology.start has the parameters of one law, and --compare-laws trains several: "
            "leave one of them out"
        )
    return [_with_law(case, name) for name in _others(config)]


def _others(config: Config) -> list[str]:
    return [name for name in COMPANIONS if name != config.law] if config.compare_laws else []


def _with_law(case: Case, name: str) -> Case:
    config = dataclasses.replace(case.config, law=name)
    fixed = fixed_values(config, case.facts)
    member = dataclasses.replace(case.member, law=LAWS[name], fixed=fixed)
    return dataclasses.replace(case, config=config, member=member)


def places(case: Case, own: int, first: int) -> dict[str, int]:
    """The place in the run of every law of a comparison.

    Args:
        own: place of the member with the law of the settings.
        first: of the first companion.
    """
    return {case.config.law: own} | {n: first + k for k, n in enumerate(_others(case.config))}


def with_free_band(result: Result, case: Case, run: TrainingLoop, place: int) -> Result:
    """The result with the band of its free curve, where the error of such curves is known."""
    curve = result.law.curve
    if result.law.name != free.LAW.name or curve is None:
        return result
    try:
        return _banded(result, _FreeCurve(result, case, run, place).band())
    except ComparisonError as error:
        law = dataclasses.replace(result.law, reason=str(error))
        return dataclasses.replace(result, law=law)


def _banded(result: Result, band: Band) -> Result:
    """The result with the band of its free curve; results of other laws stay."""
    curve = result.law.curve
    if result.law.name != free.LAW.name or curve is None:
        return result
    ends = ((band.mu - band.half).tolist(), (band.mu + band.half).tolist())
    wide = Curve(curve.I, tuple(band.mu.tolist()), *(tuple(end) for end in ends))
    law = dataclasses.replace(result.law, curve=wide, reason=None)
    return dataclasses.replace(result, law=law)


def compared(result: Result, case: Case, run: TrainingLoop, of_laws: Mapping[str, int]) -> Result:
    """The result with the comparison of all laws, and the band if its law is the free curve.

    Args:
        of_laws: place in the run of every trained law.

    Raises:
        ComparisonError: the data, or what is known of such data, do not allow it.
    """
    curve = _FreeCurve(result, case, run, of_laws[free.LAW.name])
    fixed = {name: {"I0": case.config.I0} | case.config.rheology.fixed for name in LAWS}
    band, at_knots = curve.band(), curve.covariance(law_choice.knots(curve.I_range))
    found = law_choice.fits(curve.known, curve.ends, band, at_knots, fixed)
    records, chosen = law_choice.choice(found, band)
    cohesion = _cohesion(case, run, of_laws[cohesive.LAW.name], curve)
    records, chosen = law_choice.with_cohesion(records, chosen, cohesion)
    return dataclasses.replace(_banded(result, band), comparison=records, chosen=chosen)


class _FreeCurve:
    """The free curve of a run over the range of I of a result."""

    def __init__(self, result: Result, case: Case, run: TrainingLoop, place: int) -> None:
        if changed := untested(case.config):
            raise ComparisonError(
                "the error of a free curve is that of the default recipe, and this run has "
                f"another {', '.join(changed)}"
            )
        if result.law.I_range is None or result.residuals is None:
            raise ComparisonError("the range of I of the data is not known")
        if result.law.I_range[0] >= result.law.I_range[1]:
            raise ComparisonError("the data hold one I alone, which any law explains")
        known = _quadratic(run, place, len(free.LAW.curve))
        if known is None:
            raise ComparisonError("the training with a free curve did not end with its last layer")
        self.known: Quadratic = known
        theta = run.trainer.solution(place)[1].tolist()
        self.ends = theta[-2], theta[-1]
        self.model, self.I_range = error_model.load(), result.law.I_range
        x = error_model.ends_of(self.I_range, case.config.I0)
        mu = basis(np.array(self.I_range), *self.ends) @ known.center
        if not (mu > 0).all():
            raise ComparisonError("the free curve is not positive over the range of I of the data")
        mu_s, mu_2 = np.linalg.solve(error_model.line(x), mu).tolist()
        steps = result.timing.steps
        of_run = conclusion.known_by(case, result.residuals, steps, x, (mu_s, mu_2))
        method, grains = self.model.method(of_run), self.model.grains(of_run)
        self.of_ends: Float64 = self.model.free_curve**2 * method + grains
        usual = math.exp(self.model.lower["constant"])
        self.scale = max(1.0, float(self.model.sd(of_run)[0]) / usual)

    def covariance(self, I: Float64) -> Float64:  # noqa: E741
        """Covariance of mu at every I [n, n]."""
        B = basis(I, *self.ends)
        mu = B @ self.known.center
        own = B @ self.known.covariance @ B.T
        model = model_covariance(I, mu, self.I_range, self.of_ends)
        return own + model + np.diag((LEAST * mu) ** 2)

    def band(self) -> Band:
        """The curve with its errors over the range of I."""
        I = np.geomspace(*self.I_range, POINTS)  # noqa: E741
        mu = basis(I, *self.ends) @ self.known.center
        std = np.sqrt(np.diag(self.covariance(I)))
        farthest = self.model.half_width(TOLD_APART) * std
        if (farthest > LARGEST * mu).any():
            raise ComparisonError(
                "so few steps, or so large a misfit of the velocity, leave a free curve whose "
                "error is as large as the friction"
            )
        return Band(I, mu, self.model.half_width() * std, farthest)


def _quadratic(run: TrainingLoop, place: int, L: int) -> Quadratic | None:
    """The loss around the first L free parameters of a member."""
    ended = run.trainer.ended(place)
    found = information(*ended) if ended else None
    return None if found is None else quadratic(found, L)


def _cohesion(case: Case, run: TrainingLoop, place: int, curve: _FreeCurve) -> Cohesion:
    """What the training with cohesion found."""
    law = cohesive.LAW
    known = _quadratic(run, place, len(law.free))
    if known is None:
        raise ComparisonError("the training with cohesion did not end with its last layer")
    theta = run.trainer.solution(place)[1].tolist()
    k = law.free.index("c")
    c = float(known.center[k])
    without, part = (curve.scale * e for e in (curve.model.cohesion, curve.model.cohesion_part))
    least = math.hypot(math.sqrt(known.covariance[k, k]), without)
    std = math.hypot(least, part * c)
    unit = case.scales.pressure
    values = Parameters(
        (p.name, Parameter(value, fixed=p.fixed))
        for p, value in zip(law.parameters, law.to_physical(theta, unit), strict=True)
    )
    gain = c**2 / (2 * np.linalg.inv(known.curvature)[k, k] * known.temperature)
    return Cohesion(values, c * unit, least * unit, std * unit, float(gain))
