r"""The parameters of mu(I) that the data determine, and those that only extrapolate.

With x = I/(I + I0), mu = mu_s (1 - x) + mu_2 x is a line from mu_s at x = 0 to mu_2 at x = 1. The
data show it between the smallest and the largest x. For a straight line through points of equal
error, the standard deviations at x = 0 and x = 1 over that in the middle of the points are

$$ r_s = \sqrt{1 + \bar x^2 / \mathrm{var}(x)}, \quad
   r_2 = \sqrt{1 + (1 - \bar x)^2 / \mathrm{var}(x)}. $$

The covariance of a result gives two such ratios as well. The larger one counts: error bars that
are calibrated on collapses do not contain the range of another flow. A parameter is not determined
if its standard deviation would exceed LARGEST of its value where that of mu is USUAL of mu. So the
range alone decides: an inaccurate training has wide intervals, which say so themselves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.physics.laws import mu_of_i
from granpinn.results import Parameters, Result
from granpinn.results.determined import Determined
from granpinn.results.summary import NORMAL_90, friction_sd

# Relative sd of mu: the scatter of trainings without noise, 1.5 % in mu_2 (bench/studies/noise).
USUAL = 0.015
LARGEST = 0.2


def determined(result: Result, inertial_number: Floats, weight: Floats) -> Determined | None:
    """What the data determine; None for laws other than mu(I) and flows without shear.

    Args:
        inertial_number: of the points that shear [n].
        weight: of these points in the fit [n].
    """
    if result.law.name != mu_of_i.LAW.name:
        return None
    shear = range_of(inertial_number, weight, result.parameters["I0"].value)
    if shear is None:
        return None
    at, reach = np.array([shear.I]), dict(shear.reach)
    mu = float(result.friction_law.friction(at, *result.theta)[0])
    std, interval = _at(at, mu, result)
    if std and result.covariance is not None:
        for k, name in enumerate(result.covariance.names):
            if name in reach:
                own = np.sqrt(result.covariance.matrix[k][k]) / std
                reach[name] = max(reach[name], float(own))
    lost = lost_of(reach, mu, {name: result.parameters[name].value for name in reach})
    return Determined(shear.low, shear.high, shear.I, mu, std, interval, reach, lost)


class Range(NamedTuple):
    """The 5th and 95th percentile of I, the I of the mean x, and the ratios r by parameters."""

    low: float
    high: float
    I: float  # noqa: E741 (the inertial number's own symbol)
    reach: dict[str, float]


def range_of(inertial_number: Floats, weight: Floats, I0: float) -> Range | None:
    """The range of I of points that shear [n] with weights [n]; None without such points."""
    used = _shearing(inertial_number, weight)
    if used is None:
        return None
    number, share = used
    low, high = _quantiles(number, share)
    within = (number >= low) & (number <= high)
    number, share = number[within], share[within] / share[within].sum()
    x = number / (number + I0)
    mean = float(share @ x)
    variance = max(float(share @ (x - mean) ** 2), 1e-12)
    reach = {
        "mu_s": float(np.sqrt(1 + mean**2 / variance)),
        "mu_2": float(np.sqrt(1 + (1 - mean) ** 2 / variance)),
    }
    return Range(low, high, I0 * mean / (1 - mean), reach)


def percentiles(inertial_number: Floats, weight: Floats) -> tuple[float, float] | None:
    """The 5th and 95th percentile of I of points that shear [n]; None without such points."""
    used = _shearing(inertial_number, weight)
    return None if used is None else _quantiles(*used)


def lost_of(reach: Mapping[str, float], mu: float, values: Mapping[str, float]) -> tuple[str, ...]:
    """The parameters that are not determined, by their ratios r and values; mu is at the mean x."""
    return tuple(name for name, r in reach.items() if r * USUAL * mu > LARGEST * values[name])


def unfixed(result: Result, inertial_number: Floats, weight: Floats, reason: str) -> Determined:
    """The record of a flow that determines no friction coefficient, for a reason; any law.

    Args:
        inertial_number: of the points that shear [n], with the pressure of the training.
        weight: of these points [n].
    """
    law = result.friction_law
    scale = law.inertial_scale
    shear = range_of(inertial_number, weight, result.parameters[scale].value if scale else 1.0)
    low, high, at = (0.0, 0.0, 0.0) if shear is None else (shear.low, shear.high, shear.I)
    mu = float(law.friction(np.array([at]), *result.theta)[0])
    return Determined(low, high, at, mu, None, None, {}, law.free, reason=reason)


def applied(result: Result, found: Determined) -> Result:
    """The result whose parameters that are not determined have no error bars."""
    values = dict(result.parameters.items())
    lost = {name: values[name] for name in found.lost if not values[name].fixed}
    for name, parameter in lost.items():
        values[name] = dataclasses.replace(parameter, std=None, interval_90=None, determined=False)
    std = {name: p.std for name, p in lost.items() if p.std is not None}
    intervals = {name: p.interval_90 for name, p in lost.items() if p.interval_90 is not None}
    found = dataclasses.replace(found, raw_std=std or None, raw_interval_90=intervals or None)
    return dataclasses.replace(result, parameters=Parameters(values), determined=found)


def _at(at: Float64, mu: float, result: Result) -> tuple[float | None, tuple[float, float] | None]:
    """Standard deviation and 90 % interval of mu at an I; None without error bars."""
    if result.covariance is None:
        return None, None
    std = float(friction_sd(at, result, result.covariance)[0])
    half = max(result.error_bars.half_width) if result.error_bars else NORMAL_90
    return std, (mu - half * std, mu + half * std)


def _shearing(inertial_number: Floats, weight: Floats) -> tuple[Float64, Float64] | None:
    """The points with a positive I and weight; None without such points."""
    number, share = np.asarray(inertial_number, np.float64), np.asarray(weight, np.float64)
    used = np.isfinite(number) & (number > 0) & (share > 0)
    return (number[used], share[used]) if used.any() else None


def _quantiles(values: Float64, weight: Float64) -> tuple[float, float]:
    """The weighted 5th and 95th percentile."""
    order = np.asarray(np.argsort(values), np.intp)
    share = np.cumsum(weight[order]) / weight.sum()
    low, high = np.interp((0.05, 0.95), share, values[order]).tolist()
    return low, high
