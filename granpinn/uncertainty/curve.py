r"""The curve of an identified law over the I of the data, its 90 % band, and the points behind it.

**Range.** The 5th to the 95th percentile of I over the points that shear, as for what the data
determine (determined.py). Nothing is stated beyond it.

**Band.** The covariance C of the parameters holds all that the intervals hold: seeds, noise,
further errors and assumptions. Parameters are drawn from a normal distribution,

$$ \theta_k = \theta + \frac{h}{1.645} C^{1/2} \xi_k, \qquad \xi_k \sim N(0, 1), $$

where h is the half-width of the 90 % intervals in standard deviations. Draws outside of the
admissible set of the law (such as mu_2 < mu_s) are left out. The band is from the 5th to the 95th
percentile of mu(I; theta_k) at every I. To first order in C this is mu +- h sd(mu); a wide or
skew distribution keeps its shape. The draws are a scrambled Sobol sequence (Owen, J. Complexity 14,
1998) and depend on the seed alone. Their percentiles are within 1 % of the width.

**Points.** Median, 16th and 84th percentile of |tau|/p in the fields of the fit, in bins of log I.
The stress of the mixed form is an output of the network, and the law holds for it in the mean
square only. The stress of the strong form is that of the law.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import torch

from granpinn.arrays import Float64, Floats
from granpinn.physics.laws import Law
from granpinn.results import Covariance, Result
from granpinn.results.identified_law import Curve, IdentifiedLaw, StressPoints
from granpinn.results.summary import NORMAL_90
from granpinn.uncertainty.determined import percentiles

POINTS = 80  # of a curve, evenly in log I
BINS = 20
FEWEST = 20  # points of a bin
DRAWS = 2**12
FEWEST_DRAWS = 2**8  # inside the admissible set: then percentiles are within 10 % of the width
NO_SHEAR = "no grains shear"
TOO_WIDE = "nearly all parameters within their covariance are impossible for the law"


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
    I = np.geomspace(*found, POINTS)  # noqa: E741
    I[0], I[-1] = found
    points = None if ratio is None else stress_points(inertial_number, ratio, found)
    known = result.determined
    if known is not None and known.reason is not None:
        return _with(result, I_range=found, points=points, reason=known.reason)
    law = result.friction_law
    mu = np.asarray(law.friction(I, *result.theta), np.float64)
    if result.covariance is None:
        why = result.verdict.words if result.verdict else "the result has no error bars"
        curve = Curve(tuple(I.tolist()), tuple(mu.tolist()))
        return _with(result, I_range=found, curve=curve, points=points, reason=why)
    half = max(result.error_bars.half_width) if result.error_bars else NORMAL_90
    edges = band(law, result.theta, result.covariance, half, I, result.seed)
    if edges is None:
        curve = Curve(tuple(I.tolist()), tuple(mu.tolist()))
        return _with(result, I_range=found, curve=curve, points=points, reason=TOO_WIDE)
    low, high = np.minimum(edges[0], mu), np.maximum(edges[1], mu)
    curve = Curve(*(tuple(values.tolist()) for values in (I, mu, low, high)))
    return _with(result, I_range=found, curve=curve, points=points)


def band(
    law: Law,
    theta: tuple[float, ...],
    covariance: Covariance,
    half_width: float,
    I: Float64,  # noqa: E741
    seed: int,
) -> tuple[Float64, Float64] | None:
    """Lower and upper end of the pointwise 90 % band of mu at I [n] each.

    None if nearly all parameters of the distribution are impossible.

    Args:
        theta: all parameters, in the order of the law; the ones without a covariance are exact.
        half_width: of the 90 % intervals of the parameters, in standard deviations.
    """
    drawn = np.tile(np.array(theta, np.float64), (DRAWS, 1))
    values, vectors = np.linalg.eigh(np.array(covariance.matrix, np.float64))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    places = [law.names.index(name) for name in covariance.names]
    engine = torch.quasirandom.SobolEngine(len(places), scramble=True, seed=seed)  # type: ignore[no-untyped-call]
    uniform = engine.draw(DRAWS, dtype=torch.float64).clamp(1e-12, 1 - 1e-12)
    drawn[:, places] += half_width / NORMAL_90 * torch.special.ndtri(uniform).numpy() @ root.T
    drawn = drawn[[law.admits(row) for row in drawn.tolist()]]
    if len(drawn) < FEWEST_DRAWS:
        return None
    at = torch.as_tensor(I).repeat(len(drawn))
    every = torch.as_tensor(drawn).repeat_interleave(len(I), dim=0)
    mu = law.friction(at, *every.unbind(1)).reshape(len(drawn), len(I)).numpy()
    low, high = np.quantile(mu, (0.05, 0.95), axis=0)
    return low, high


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
    I, lower, mu, upper, counts = zip(*rows, strict=True)  # noqa: E741
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
