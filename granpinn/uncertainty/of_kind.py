r"""Error bars for flows other than the collapses that the error bars are calibrated on.

The calibration table may state, for a kind of flow, how wrong mu(I) was in identifications of
grains whose law is known (`ModelError`). The relative error of mu over the range of I of a flow is
taken as a level and a tilt,

$$ \frac{\delta\mu}{\mu} = a + b\,\xi, \qquad \xi = -1 \text{ at the 5th},\ +1 \text{ at the 95th
   percentile of } I, $$

with independent a and b of the stated standard deviations. As mu(I) is a straight line in
x = I/(I + I0), the errors at both ends give those of mu_s and mu_2, also beyond the range: a short
range is a long extrapolation. Scatter over seeds and assumptions are added. A kind without an entry
has no data, and error bars as before: none, but for collapses.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Config
from granpinn.data.symmetry import WORDS
from granpinn.results import Covariance, Parameters, Result
from granpinn.results.records import Verdict
from granpinn.uncertainty import calibration, error_bars, of_assumptions
from granpinn.uncertainty.calibration import KINDS, Calibration, ModelError
from granpinn.uncertainty.determined import Range
from granpinn.uncertainty.held import Held, ends_of, line
from granpinn.uncertainty.of_training import uncalibrated


def kind_of(symmetries: Sequence[str], carried: bool, of_solver: bool) -> str | None:
    """One of `KINDS`; None for a collapse of a solver, as in the calibration.

    Args:
        symmetries: of the flow, in words (granpinn/data/symmetry.py).
        carried: whether walls carry the grains (results/baseline.py).
        of_solver: whether a solver made the data.
    """
    uniform, steady = (WORDS[axis] in symmetries for axis in (0, 2))
    if carried:
        return "carried"
    if uniform:
        return "steady_layer" if steady else "layer"
    if steady:
        return "steady"
    return None if of_solver else "collapse"


def with_model_error(
    result: Result, config: Config, kind: str | None, shear: Range, table: Calibration | None = None
) -> Result:
    """The result with error bars from the model error of its kind of flow, if the table has one.

    Args:
        shear: the range of I of the grains that shear.
        table: by default that of the level.
    """
    table = table or calibration.of_level(config.level)
    if kind is None or table is None or kind not in table.model_error:
        return result
    if result.members is None or result.residuals is None or result.stopped == "diverged":
        return result
    if result.law.name != table.law or uncalibrated(config):
        return result
    if of_assumptions.unknown(result.assumptions):
        return result
    entry = table.model_error[kind]
    mu = error_bars.middle(result.members)
    I0 = result.parameters["I0"].value
    model = covariance(entry, mu, I0, shear) / mu[0] ** 2
    parts = [error_bars.scatter(result.members, table)]
    if kind == "collapse":  # the errors of simulated collapses as well
        held = Held(ends_of((shear.low, shear.high), I0))
        steps = result.timing.steps
        parts += error_bars.further(result.members, result.residuals, steps, table, held)
    parts.append((model, entry.flows))
    wide = dataclasses.replace(table, provenance=entry.provenance, widening=(1.0, 1.0))
    found = error_bars.combined(mu, parts, wide, result.assumptions)
    parameters = dict(result.parameters.items())
    for name, std, interval in zip(("mu_s", "mu_2"), found.std, found.intervals, strict=True):
        p = parameters[name]
        parameters[name] = dataclasses.replace(p, std=std, interval_90=interval)
    rows = tuple(tuple(row) for row in found.covariance.tolist())
    return dataclasses.replace(
        result,
        parameters=Parameters(parameters),
        covariance=Covariance(("mu_s", "mu_2"), rows),
        error_bars=found.bars,
        verdict=_verdict(result.verdict, kind, entry),
    )


def covariance(entry: ModelError, mu: tuple[float, float], I0: float, shear: Range) -> Float64:
    """Covariance of (mu_s, mu_2) that the errors at the ends of a range of I imply [2, 2]."""
    J = line(ends_of((shear.low, shear.high), I0))
    errors = (J @ np.array(mu))[:, None] * np.array([[1.0, -1.0], [1.0, 1.0]])
    back = np.linalg.solve(J, errors * np.array([entry.level, entry.tilt]))
    return np.asarray(back @ back.T)


def _verdict(verdict: Verdict | None, kind: str, entry: ModelError) -> Verdict | None:
    """The verdict of a collapse stays; for others the words say what the error bars are."""
    if kind == "collapse" or verdict is None:
        return verdict
    words = (
        "no verdict, as its residuals are calibrated on collapses; the error bars come from "
        f"{entry.flows:g} flows of grains {KINDS[kind]}, whose mu(I) was "
        f"{100 * entry.level:.2g} % wrong"
    )
    return dataclasses.replace(verdict, words=words)
