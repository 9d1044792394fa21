"""The free surface as a height over the ground, at the columns of a grid."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64

SAME_TIME = 1e-6  # relative difference of times that are one


def line_heights(
    t: Float64, along: Float64, line_t: Float64, line_along: Float64, line_up: Float64
) -> Float64:
    """Height of the surface line in every frame and column [T, X], linear between its points.

    Points belong to the frame nearest in time. A frame has the line of the time nearest to its own
    among them. Without a line, and beyond its ends, the height is NaN.

    Args:
        t: times of the frames [T], increasing.
        along: places of the columns along the ground [X].
        line_t, line_along, line_up: time, place and height of the points [n], in any order.
    """
    height = np.full((len(t), len(along)), np.nan)
    frame = np.searchsorted((t[1:] + t[:-1]) / 2, line_t)
    for k, time in enumerate(t):
        times = line_t[frame == k]
        if times.size == 0:
            continue
        nearest = times[np.argmin(np.abs(times - time))]
        now = (frame == k) & np.isclose(line_t, nearest, rtol=SAME_TIME, atol=0.0)
        order = np.argsort(line_along[now], kind="stable")
        points = line_along[now][order], line_up[now][order]
        height[k] = np.interp(along, *points, left=np.nan, right=np.nan)
    return height
