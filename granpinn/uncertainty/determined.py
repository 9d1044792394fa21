r"""What the range of I determines: parameters of mu(I), and the curve of any law with its band.

The law is a line in x = I/(I + I0) that the data show between two ends. The error model continues
it to mu_s at x = 0 and mu_2 at x = 1 (error_model.py). A parameter is not determined if its
standard deviation would exceed `LARGEST` of its value in usual flows with this range of I, which
have no noise. Noise or a short training can widen its interval beyond `USELESS`: then it is not
determined either, whatever the law.

**Range.** The 5th to the 95th percentile of I over the points that shear. Nothing is stated beyond
it.

**Band.** To first order in the covariance C of the parameters, which holds all that the intervals
hold, the standard deviation of mu(I) is $\sqrt{J C J^T}$ with $J = \partial \mu / \partial \theta$.
mu(I) is linear in its parameters. The band is pointwise, from Student's distribution and symmetric
in log mu, like the intervals of the parameters.

**Points.** Median, 16th and 84th percentile of |tau|/p in the fields of the fit, in bins of log I.
The stress of the mixed form is an output of the network, and the law holds for it in the mean
square only. The stress of the strong form is that of the law.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from granpinn.arrays import Floats
from granpinn.physics.laws import mu_of_i
from granpinn.results import Parameters, Result
from granpinn.results.parameters import USELESS, half_width, spans
from granpinn.results.records import Curve, IdentifiedLaw, StressPoints
from granpinn.results.result import NORMAL_90, friction_sd
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.error_model import Known, Pair, ends_of, interval

# Of mu_s and mu_2 the 90 % interval is then wider than a quarter. Published values of I0 scatter by
# 0.3: a wider error says nothing new.
LARGEST = {"mu_s": 0.15, "mu_2": 0.15, "I0": 0.3}


def determined(result: Result, ranges: Sequence[Pair]) -> dict[str, str]:
    """The parameters that the data do not determine, and why.

    Args:
        ranges: of I, of all flows that have this law.
    """
    intervals = {name: p.interval_90 for name, p in result.parameters.items()}
    halves = {name: half_width(i) for name, i in intervals.items() if i is not None}
    lost = {name: spans(half) for name, half in halves.items() if half > USELESS}
    # One law with a free I0 comes only from flows that determine I0 (one_law.py).
    if result.law.name == mu_of_i.LAW.name and result.parameters["I0"].fixed:
        mu_s, mu_2, I0 = result.theta
        bars = result.error_bars
        real = bars is not None and bars.grains is not None
        known = [Known(ends_of(e, I0), (mu_s, mu_2), real=real) for e in ranges]
        low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
        narrow = f"the grains shear at I = {low:.2g} to {high:.2g} only"
        lost |= dict.fromkeys(lost_of(known), narrow)
    return lost


def percentiles(inertial_number: Floats, weight: Floats | None = None) -> Pair | None:
    """The 5th and 95th percentile of I of points that shear [n], with weights [n].

    None without a positive I and weight.
    """
    number = np.asarray(inertial_number, np.float64)
    share = np.ones(number.shape) if weight is None else np.asarray(weight, np.float64)
    used = np.isfinite(number) & (number > 0) & (share > 0)
    if not used.any():
        return None
    number, share = number[used], share[used]
    order = np.asarray(np.argsort(number), np.intp)
    part = np.cumsum(share[order]) / share.sum()
    low, high = np.interp((0.05, 0.95), part, number[order]).tolist()
    return low, high


def lost_of(flows: Sequence[Known]) -> tuple[str, ...]:
    """The parameters that are not determined by one flow, or by all flows that have one law."""
    law, sd = flows[0].parameters, error_bars.sd_of(flows, error_model.load())
    return tuple(name for name in law if sd[name] > LARGEST[name] * law[name])


def applied(result: Result, lost: Mapping[str, str]) -> Result:
    """The result whose parameters that are not determined have a reason, and no error.

    Args:
        lost: these parameters, and why.
    """
    values = dict(result.parameters.items())
    for name, why in lost.items():
        values[name] = dataclasses.replace(values[name], std=None, undetermined=why)
    return dataclasses.replace(result, parameters=Parameters(values))


POINTS = 80  # of a curve, evenly in log I
BINS = 20
FEWEST = 20  # points of a bin
NO_SHEAR = "no grains shear"


def with_curve(result: Result, I_range: Pair | None, points: StressPoints | None = None) -> Result:
    """The result with its law over a range of I; None: no grains shear."""
    curve, reason = None, NO_SHEAR if I_range is None else result.no_law
    if I_range is not None and reason is None:
        I = np.geomspace(*I_range, POINTS)
        I[0], I[-1] = I_range
        mu = np.asarray(result.friction_law.friction(I, *result.theta), np.float64)
        low = high = None
        if result.covariance is None:
            reason = result.law.reason or "the result has no error bars"
        else:
            sd = friction_sd(I, result, result.covariance)
            half = result.error_bars.half_width if result.error_bars else NORMAL_90
            ends = [interval(m, s, half) for m, s in zip(mu.tolist(), sd.tolist(), strict=True)]
            low, high = zip(*ends, strict=True)
        curve = Curve(tuple(I.tolist()), tuple(mu.tolist()), low, high)
    law = IdentifiedLaw(result.law.name, I_range, curve, points, reason)
    return dataclasses.replace(result, law=law)


def stress_points(
    inertial_number: Floats, ratio: Floats, I_range: tuple[float, float]
) -> StressPoints | None:
    """|tau|/p [n] in bins of log I over the range; None without a bin of enough points."""
    number, ratio = np.asarray(inertial_number, np.float64), np.asarray(ratio, np.float64)
    low, high = I_range
    known = np.isfinite(ratio) & (number >= low) & (number <= high)
    number, ratio = number[known], ratio[known]
    bins = BINS if high > low else 1
    edges = np.geomspace(low, high, bins + 1)
    place = np.clip(np.searchsorted(edges, number, side="right") - 1, 0, bins - 1)
    rows = []
    for k in range(bins):
        here = place == k
        if (count := int(here.sum())) >= FEWEST:
            spread = np.quantile(ratio[here], (0.16, 0.5, 0.84)).tolist()
            rows.append((float(np.median(number[here])), *spread, count))
    if not rows:
        return None
    I, lower, mu, upper, counts = zip(*rows, strict=True)
    return StressPoints(I, mu, lower, upper, counts)
