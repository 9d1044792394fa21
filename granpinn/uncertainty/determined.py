"""The parameters of mu(I) that the data determine, and those that only extrapolate.

The law is a line in x = I/(I + I0) that the data show between two ends. The error model continues
it to mu_s at x = 0 and mu_2 at x = 1 (error_model.py). A parameter is not determined if its
standard deviation would exceed `LARGEST` of its value in usual flows with this range of I, which
have no noise. Noise or a short training can widen its interval beyond `USELESS`: then it is not
determined either, whatever the law.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.physics.laws import mu_of_i
from granpinn.results import Parameters, Result
from granpinn.results.parameters import USELESS, Determined, half_width
from granpinn.results.summary import friction_sd
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.error_model import Known, Pair, ends_of, interval

# Of mu_s and mu_2 the 90 % interval is then wider than a quarter. Published values of I0 scatter by
# 0.3: a wider error says nothing new.
LARGEST = {"mu_s": 0.15, "mu_2": 0.15, "I0": 0.3}


def determined(
    result: Result, inertial_number: Floats, weight: Floats, ranges: Sequence[Pair] = ()
) -> Determined | None:
    """What the data determine; None for flows without shear, and for another law if it is all.

    Args:
        inertial_number: of the points that shear [n].
        weight: of these points in the fit [n].
        ranges: of I of all flows that have this law; (): this flow only.
    """
    shear = _range(result, inertial_number, weight)
    return None if shear is None else determined_over(result, shear, ranges)


def determined_over(result: Result, shear: Range, ranges: Sequence[Pair] = ()) -> Determined | None:
    """What data with a range of I determine; `ranges` and None as for `determined`."""
    intervals = {name: p.interval_90 for name, p in result.parameters.items()}
    wide = [name for name, i in intervals.items() if i is not None and half_width(i) > USELESS]
    bars, at, lost = result.error_bars, np.array([shear.I]), tuple(wide)
    if result.law.name == mu_of_i.LAW.name:
        mu_s, mu_2, I0 = result.theta
        real = bars is not None and bars.grains is not None
        every = ranges or [(shear.low, shear.high)]
        free = None if result.parameters["I0"].fixed else I0
        known = [Known(ends_of(e, I0), (mu_s, mu_2), real=real, I0=free) for e in every]
        narrow = lost_of(known)
        lost = tuple(name for name in intervals if name in wide or name in narrow)
        wide = [name for name in wide if name not in narrow]
    elif not wide:
        return None
    mu, std, mu_90 = float(result.friction_law.friction(at, *result.theta)[0]), None, None
    if result.covariance is not None and bars is not None:
        std = float(friction_sd(at, result, result.covariance)[0])
        mu_90 = interval(mu, std, bars.half_width)
    return Determined(shear.low, shear.high, shear.I, mu, std, mu_90, lost, wide=tuple(wide))


class Range(NamedTuple):
    """The 5th and 95th percentile of I, and the I of the mean x."""

    low: float
    high: float
    I: float


def range_of(inertial_number: Floats, weight: Floats, I0: float) -> Range | None:
    """The range of I of points that shear [n] with weights [n]; None without such points."""
    used = _shearing(inertial_number, weight)
    if used is None:
        return None
    number, share = used
    low, high = _quantiles(number, share)
    within = (number >= low) & (number <= high)
    x = number[within] / (number[within] + I0)
    mean = float(np.average(x, weights=share[within]))
    return Range(low, high, I0 * mean / (1 - mean))


def _range(result: Result, inertial_number: Floats, weight: Floats) -> Range | None:
    """The range of I, with the I0 of a result, if its law has one."""
    scale = result.friction_law.inertial_scale
    return range_of(inertial_number, weight, result.parameters[scale].value if scale else 1.0)


def percentiles(inertial_number: Floats, weight: Floats) -> tuple[float, float] | None:
    """The 5th and 95th percentile of I of points that shear [n]; None without such points."""
    used = _shearing(inertial_number, weight)
    return None if used is None else _quantiles(*used)


def lost_of(flows: Sequence[Known]) -> tuple[str, ...]:
    """The parameters that are not determined by one flow, or by all flows that have one law."""
    law, sd = flows[0].parameters, error_bars.sd_of(flows, error_model.load())
    return tuple(name for name in law if sd[name] > LARGEST[name] * law[name])


def unfixed(result: Result, inertial_number: Floats, weight: Floats, reason: str) -> Determined:
    """The record of a flow that determines no friction coefficient, for a reason; any law.

    Args:
        inertial_number: of the points that shear [n], with the pressure of the training.
        weight: of these points [n].
    """
    law, shear = result.friction_law, _range(result, inertial_number, weight)
    low, high, at = (0.0, 0.0, 0.0) if shear is None else shear
    mu = float(law.friction(np.array([at]), *result.theta)[0])
    return Determined(low, high, at, mu, None, None, law.free, reason=reason)


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
