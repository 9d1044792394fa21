r"""Error bars of (mu_s, mu_2): the error model, continued to x = 0 and x = 1; for mu(I) alone.

The covariance of the center of an ensemble has up to four parts,

$$ C = J (M + G) J^T + S / K + A : $$

M is the covariance of the errors of log mu at both ends of the range of I, G that of the departure
of real grains from mu(I) (error_model.py), and J continues the line through both ends. S is the
scatter of K > 1 members over seeds. A is the effect of assumptions, such as the offset of the
surface line (of_assumptions.py).

Intervals are from Student's distribution and symmetric in log mu, so friction stays positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.results import Covariance, Parameter
from granpinn.results.assumed import Assumed
from granpinn.results.records import ErrorBars, Members
from granpinn.uncertainty.center import values_of
from granpinn.uncertainty.error_model import ErrorModel, Known, Pair, continued, interval
from granpinn.uncertainty.of_assumptions import covariance

NAMES = ("mu_s", "mu_2")


class Estimate(NamedTuple):
    """The identified parameters by name, their covariance, and its parts."""

    parameters: dict[str, Parameter]
    covariance: Covariance
    bars: ErrorBars


def estimate(
    members: Members, known: Known, model: ErrorModel, assumed: Sequence[Assumed] = ()
) -> Estimate:
    """Error bars of the center `known.mu` of an ensemble."""
    parts = {
        "method": continued(model.method(known), known),
        "grains": continued(model.grains(known), known),
        "scatter": scatter(members),
        "assumptions": covariance(assumed, NAMES),
    }
    C = sum(parts.values(), np.zeros((2, 2)))
    half, sd = model.half_width(), np.sqrt(np.diag(C)).tolist()
    parameters = {
        name: Parameter(mu, False, s, interval(mu, s, half))
        for name, mu, s in zip(NAMES, known.mu, sd, strict=True)
    }
    method = _pair(parts.pop("method"))
    bars = ErrorBars(
        method=method,
        **{name: _pair(matrix) if matrix.any() else None for name, matrix in parts.items()},
        freedom=model.freedom,
        half_width=half,
        outside=model.outside(known),
        provenance=model.provenance,
    )
    return Estimate(parameters, Covariance(NAMES, tuple(map(tuple, C.tolist()))), bars)


def sd_of(known: Known, model: ErrorModel) -> Pair:
    """Standard deviations of (mu_s, mu_2) in runs of which no more is known."""
    return _pair(continued(model.method(known) + model.grains(known), known))


def scatter(members: Members) -> Float64:
    """Covariance of the mean of (mu_s, mu_2) over the members [2, 2]; 0 for one member."""
    values = values_of(members)
    K = len(values)
    if K < 2:
        return np.zeros((2, 2))
    return np.asarray(np.cov(values, rowvar=False) / K)


def _pair(C: Float64) -> Pair:
    """Standard deviations."""
    first, second = np.sqrt(np.diag(C)).tolist()
    return first, second
