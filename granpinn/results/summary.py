"""The numbers behind the words of a report, derived from a result and its history.

The flow shows its friction law only over the inertial numbers that it has. Hence the law is summed
up over the band of I that the middle 90 % of the grains cover, beside its parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch

from granpinn.arrays import Floats
from granpinn.physics.laws import LAWS, mu_of_i
from granpinn.results.result import Covariance, Result

LAST_PART = 0.1  # of the steps: how much the parameters still changed
BAND_POINTS = 200
NORMAL_90 = 1.645  # half-width of the central 90 % of a normal distribution, in sd


class Band(NamedTuple):
    """The friction law over the inertial numbers that the data cover.

    Attributes:
        largest_difference: between the identified and the true law; None if the latter is unknown.
        half_width: half of the 90 % band at its widest place; None without error bars.
    """

    I_low: float
    I_high: float
    mu_low: float
    mu_high: float
    largest_difference: float | None
    half_width: float | None = None


class Summary(NamedTuple):
    """
    Attributes:
        slope: (mu_2 - mu_s) / I0, the slope of mu(I) at I = 0; None for other laws.
        reaches: I_high / I0; mu_2 is an extrapolation where it is far below 1; None for other laws.
        stagnant: share of the scored points in stagnant zones.
        drift: relative change of each identified parameter over the last tenth of the steps.
    """

    slope: float | None
    band: Band | None
    reaches: float | None
    stagnant: float | None
    drift: dict[str, float] | None


def summarize(result: Result, history: Mapping[str, Floats] | None = None) -> Summary:
    """What the page says in words; None for what is not known."""
    band = _band(result)
    zones = result.zones
    scored = zones.n_flowing + zones.n_stagnant if zones else 0
    slope = reaches = None
    if result.law == mu_of_i.LAW.name:
        mu_s, mu_2, I0 = result.theta
        slope = (mu_2 - mu_s) / I0
        reaches = band.I_high / I0 if band else None
    return Summary(
        slope=slope,
        band=band,
        reaches=reaches,
        stagnant=zones.n_stagnant / scored if zones and scored else None,
        drift=_drift(LAWS[result.law].free, history) if history else None,
    )


def true_theta(result: Result) -> tuple[float, ...] | None:
    """The true parameters in the order of the law; None if one of them is unknown.

    A fixed parameter with an unknown true value counts as true.
    """
    theta = []
    for name in LAWS[result.law].names:
        given, true = result.parameters[name], getattr(result.truth, name, None)
        if true is None and not given.fixed:
            return None
        theta.append(given.value if true is None else float(true))
    return tuple(theta)


def _band(result: Result) -> Band | None:
    if result.inertial_number is None:
        return None
    low, high = result.inertial_number.q05, result.inertial_number.q95
    I = np.linspace(low, high, BAND_POINTS)  # noqa: E741
    law, truth = LAWS[result.law], true_theta(result)
    mu = law.friction(I, *result.theta)
    largest = None
    if truth is not None:
        largest = float(np.max(np.abs(mu - law.friction(I, *truth))))
    known = result.covariance
    half = None if known is None else float(np.max(half_width(I, result, known)))
    return Band(low, high, float(mu[0]), float(mu[-1]), largest, half)


def half_width(I: Floats, result: Result, covariance: Covariance) -> Floats:  # noqa: E741
    """Half of the 90 % band of the law [n]; the widest interval of the parameters counts."""
    bars = result.error_bars
    width = max(bars.half_width) if bars else NORMAL_90
    return width * friction_sd(I, result, covariance)


def friction_sd(I: Floats, result: Result, covariance: Covariance) -> Floats:  # noqa: E741
    r"""Standard deviation of the law [n] from the covariance C of its parameters, to first order:

    $$ \sigma_\mu^2 = J\,C\,J^T, \quad J = \partial \mu / \partial \theta. $$
    """
    law = LAWS[result.law]
    theta = torch.tensor(result.theta, dtype=torch.float64)
    at = torch.as_tensor(np.asarray(I, np.float64))
    jacobian: Any = torch.autograd.functional.jacobian
    rows = jacobian(lambda values: law.friction(at, *values), theta)
    J = rows[:, [law.names.index(name) for name in covariance.names]].numpy()
    variance = np.einsum("ni,ij,nj->n", J, np.array(covariance.matrix), J)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _drift(names: Sequence[str], history: Mapping[str, Floats]) -> dict[str, float] | None:
    """|last - value at 0.9 of the steps| / |last| of parameters."""
    step = history["step"]
    if step.size < 2:
        return None
    before = int(np.argmin(np.abs(step - (1 - LAST_PART) * step[-1])))
    changes = {}
    for name in names:
        last, then = history[name][-1], history[name][before]
        if before == step.size - 1 or not (np.isfinite(last + then) and last):
            return None
        changes[name] = float(abs(last - then) / abs(last))
    return changes
