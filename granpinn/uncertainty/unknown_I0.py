r"""Errors of mu_s, of the slope (mu_2 - mu_s)/I0 and of I0 of mu(I), where I0 is not known.

A profile of I0 has the law for every I0 of its grid. The error bars of a run hold for its own I0.
They are errors of mu at the ends of the range of I, and these are the same for every I0: where
$J_v$ maps (mu_s, mu_2) to mu at both ends for the I0 of value v, and C is the covariance of the
run, the covariance for value v is $C_v = J_v^{-1} (J C J^T) J_v^{-T}$.

Every value of I0 that the profile does not exclude is equally likely. The grid is even in log I0,
so this is a uniform prior in log I0 over the grid. The intervals are the central 90 % of the
mixture of the laws. Those of mu_s are lognormal, those of the slope normal. I0 itself has an
interval where both ends of the grid are excluded, and is else not determined.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.optimize at its first use
from scipy.special import ndtr

from granpinn.arrays import Float64
from granpinn.results import Parameter, Parameters, Result
from granpinn.results.result import NORMAL_90
from granpinn.uncertainty.error_model import ends_of, line

TAIL = 0.05  # of a mixture, at either side of its 90 % interval
WIDE = 40.0  # standard deviations beyond all parts of a mixture


@dataclass(frozen=True)
class ProfilePoint:
    """One value of I0 of mu(I): the law that was identified with it, and whether it is excluded.

    Attributes:
        mu_s, mu_2, slope: means over the seeds; slope = (mu_2 - mu_s) / I0.
        loss_rise: loss minus the loss at the best I0 with the same seed, mean over the seeds.
        law_difference: largest |mu(I) - mu(I) at the best I0| over the I that the data cover.
        excluded: whether the data exclude this I0.
    """

    I0: float
    mu_s: float
    mu_2: float
    slope: float
    loss_rise: float
    law_difference: float
    excluded: bool


def unknown_I0(
    points: Sequence[ProfilePoint],
    best: float | None,
    bounds: tuple[float | None, float | None],
    result: Result,
) -> Parameters | None:
    """mu_s, slope and I0 where I0 is not known; None without error bars.

    Args:
        best, bounds: estimate and bounds of I0; None where there is none.
        result: the run at its own I0, with the error bars of that.
    """
    law, shear, bars = result.covariance, result.determined, result.error_bars
    if law is None or shear is None or bars is None or law.names != ("mu_s", "mu_2"):
        return None
    run_I0 = result.parameters["I0"].value
    J = line(ends_of((shear.I_low, shear.I_high), run_I0))
    of_ends = J @ np.array(law.matrix) @ J.T
    allowed = [point for point in points if not point.excluded]
    each = [_sd_at(point, of_ends, (shear.I_low, shear.I_high)) for point in allowed]
    widths = bars.half_width / NORMAL_90  # Student's distribution
    sd_s, sd_slope = (np.array(each) * widths).T
    mu_s = np.array([point.mu_s for point in allowed])
    slope = np.array([point.slope for point in allowed])
    return Parameters(
        mu_s=_mixture(np.log(mu_s), sd_s / mu_s, logarithmic=True),
        slope=_mixture(slope, sd_slope),
        I0=_of_I0(best, bounds, run_I0),
    )


def _sd_at(point: ProfilePoint, of_ends: Float64, shear: tuple[float, float]) -> Float64:
    """Standard deviations [2] of mu_s and slope at one I0, from the covariance at the ends."""
    back = np.linalg.inv(line(ends_of(shear, point.I0)))
    slope_of = np.array([[1.0, 0.0], [-1 / point.I0, 1 / point.I0]]) @ back
    return np.asarray(np.sqrt(np.diag(slope_of @ of_ends @ slope_of.T)))


def _mixture(mean: Float64, sd: Float64, logarithmic: bool = False) -> Parameter:
    """Median, standard deviation and central 90 % of equal parts of normal distributions [n]."""

    def quantile(q: float) -> float:
        reach = WIDE * float(sd.max())
        ends = float(mean.min()) - reach, float(mean.max()) + reach
        return float(
            scipy.optimize.brentq(lambda x: float(ndtr((x - mean) / sd).mean()) - q, *ends)
        )

    middle, low, high = (quantile(q) for q in (0.5, TAIL, 1 - TAIL))
    std = math.sqrt(float((sd**2).mean() + mean.var()))
    if logarithmic:
        middle, low, high = (math.exp(x) for x in (middle, low, high))
        std *= middle
    return Parameter(middle, False, std, (low, high))


def _of_I0(
    best: float | None, bounds: tuple[float | None, float | None], given: float
) -> Parameter:
    low, high = bounds
    if best is None or low is None or high is None:
        return Parameter(given, False, determined=False)
    return Parameter(best, False, interval_90=(low, high))
