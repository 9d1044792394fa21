r"""The curve of an identified law over the I of the data, its 90 % band, and the points behind it.

**Range.** The 5th to the 95th percentile of I over the points that shear, as for what the data
determine (determined.py). Nothing is stated beyond it.

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

import numpy as np

from granpinn.arrays import Floats
from granpinn.results import Result
from granpinn.results.identified_law import Curve, IdentifiedLaw, StressPoints
from granpinn.results.summary import NORMAL_90, friction_sd
from granpinn.uncertainty.determined import percentiles
from granpinn.uncertainty.error_model import interval

POINTS = 80  # of a curve, evenly in log I
BINS = 20
FEWEST = 20  # points of a bin
NO_SHEAR = "no grains shear"


def with_curve(
    result: Result, inertial_number: Floats, weight: Floats, ratio: Floats | None = None
) -> Result:
    """The result with its law over the range of I of the data.

    Args:
        inertial_number: of the points that shear [n].
        weight: of these points in the fit [n].
        ratio: |tau|/p at these points [n], NaN where p <= 0; None: not known.
    """
    found = percentiles(inertial_number, weight)
    if found is None:
        return _with(result, reason=NO_SHEAR)
    points = None if ratio is None else stress_points(inertial_number, ratio, found)
    return over(result, found, points)


def over(result: Result, found: tuple[float, float], points: StressPoints | None = None) -> Result:
    """The result with its law over a range of I."""
    I = np.geomspace(*found, POINTS)
    I[0], I[-1] = found
    known = result.determined
    if known is not None and known.reason is not None:
        return _with(result, I_range=found, points=points, reason=known.reason)
    law = result.friction_law
    mu = np.asarray(law.friction(I, *result.theta), np.float64)
    if result.covariance is None:
        why = result.law.reason or "the result has no error bars"
        curve = Curve(tuple(I.tolist()), tuple(mu.tolist()))
        return _with(result, I_range=found, curve=curve, points=points, reason=why)
    sd = friction_sd(I, result, result.covariance)
    half = result.error_bars.half_width if result.error_bars else NORMAL_90
    ends = [interval(m, s, half) for m, s in zip(mu.tolist(), sd.tolist(), strict=True)]
    low, high = zip(*ends, strict=True)
    curve = Curve(tuple(I.tolist()), tuple(mu.tolist()), low, high)
    return _with(result, I_range=found, curve=curve, points=points)


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


def _with(
    result: Result,
    I_range: tuple[float, float] | None = None,
    curve: Curve | None = None,
    points: StressPoints | None = None,
    reason: str | None = None,
) -> Result:
    law = IdentifiedLaw(result.law.name, I_range, curve, points, reason)
    return dataclasses.replace(result, law=law)
