"""The numbers behind the words of a report, derived from a result.

The flow shows its friction law only over the inertial numbers that it has. Hence the law is summed
up over the range of I of its curve, beside its parameters.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.physics.laws import mu_of_i
from granpinn.physics.rheology import by_parameters
from granpinn.results.parameters import Covariance
from granpinn.results.result import Result

BAND_POINTS = 200  # of laws that are compared over a range of I
NORMAL_90 = 1.645  # half-width of the central 90 % of a normal distribution, in sd


class Band(NamedTuple):
    """The friction law over the range of I of its curve.

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
        reaches: I of the grains (95 %) over I0; mu_2 is an extrapolation where it is far below 1;
            None for other laws.
        stagnant: share of the scored points in stagnant zones.
    """

    slope: float | None
    band: Band | None
    reaches: float | None
    stagnant: float | None


def summarize(result: Result) -> Summary:
    """What the page says in words; None for what is not known."""
    band = _band(result)
    zones = result.zones
    scored = zones.n_flowing + zones.n_stagnant if zones else 0
    slope = reaches = None
    if result.law.name == mu_of_i.LAW.name:
        mu_s, mu_2, I0 = result.theta
        slope = (mu_2 - mu_s) / I0
        reaches = result.inertial_number.q95 / I0 if result.inertial_number else None
    return Summary(
        slope=slope,
        band=band,
        reaches=reaches,
        stagnant=zones.n_stagnant / scored if zones and scored else None,
    )


def true_friction(result: Result, I: Floats) -> Float64 | None:
    """mu of the law that made the data, at I [n]; None if one of its parameters is unknown.

    A parameter with an unknown true value that was given in the identification counts as true.
    """
    truth = result.truth
    if truth is None:
        return None
    law, theta = truth.friction_law, []
    for name, true in zip(law.names, truth.theta, strict=True):
        given = result.parameters.get(name) if law.name == result.law.name else None
        if true is None and (given is None or not given.fixed):
            return None
        theta.append(float(true if true is not None or given is None else given.value))
    return np.asarray(law.friction(np.asarray(I, np.float64), *theta), np.float64)


def _band(result: Result) -> Band | None:
    curve = result.law.curve
    if curve is None:
        return None
    mu, truth = np.array(curve.mu), true_friction(result, np.array(curve.I))
    largest = None if truth is None else float(np.max(np.abs(mu - truth)))
    return Band(curve.I[0], curve.I[-1], curve.mu[0], curve.mu[-1], largest, curve.half_width)


def friction_sd(I: Floats, result: Result, covariance: Covariance) -> Floats:
    r"""Standard deviation of the law [n] from the covariance C of its parameters, to first order:

    $$ \sigma_\mu^2 = J\,C\,J^T, \quad J = \partial \mu / \partial \theta. $$
    """
    law = result.friction_law
    rows = by_parameters(law, np.asarray(I, np.float64), result.theta)
    J = rows[:, [law.names.index(name) for name in covariance.names]]
    variance = np.einsum("ni,ij,nj->n", J, np.array(covariance.matrix), J)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
