"""How late the surface line is against the vectors: a material line moves with the grains.

The surface y = h(x, t) rises with w = v - u h_x. If the line is late by s, it stands at

    h(t - s) = h(t) - s w,

so its height over the uppermost vectors falls by s for each unit of w. The slope of a straight
line through both gives s. Neither a constant offset of the line nor noise of the vectors, which has
no part in that height, changes it much. A line of another frame rate is late in part of the film.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.inspection.upright import Upright

TOP = 3  # uppermost cells of a column, of which the mean velocity is taken
FEWEST = 50  # columns of all frames


@dataclass(frozen=True)
class Lag:
    """
    Attributes:
        time: by which the line is late; negative: early.
        cells: rms way of the surface in that time, in cells.
        explained: share of the variance of the height over the vectors that the lag explains.
    """

    time: float
    cells: float
    explained: float


def lag_of(pose: Upright, grains: Bool, top: Float64, whole: Bool) -> Lag | None:
    """The lag of the line; None with few columns, or where the surface does not move.

    Args:
        pose: the flow, gravity downward.
        grains: cells with vectors below a line [T, Y, X].
        top: height of the uppermost ones [T, X].
        whole: columns without holes [T, X].
    """
    dy = float(np.diff(pose.y).mean())
    upper = grains & (pose.y[:, None] > top[:, None] - (TOP - 0.5) * dy)
    count = np.maximum(upper.sum(axis=1), 1)
    u, v = (np.where(upper, a, 0.0).sum(axis=1) / count for a in (pose.u, pose.v))
    rise = v - u * np.gradient(pose.height, pose.x, axis=1)
    used = whole & pose.clear & np.isfinite(rise)
    if used.sum() < FEWEST:
        return None
    w, gap = rise[used], (pose.height - top)[used]
    rms = math.sqrt(float(np.mean(w * w)))
    w, gap = w - w.mean(), gap - gap.mean()
    together, variances = float(w @ gap), (float(w @ w), float(gap @ gap))
    if min(variances) <= 0:
        return None
    time = -together / variances[0]
    return Lag(time, abs(time) * rms / dy, together**2 / math.prod(variances))
