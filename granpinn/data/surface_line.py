"""The free surface as a height over the ground, at the columns of a grid; and where it has none."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from granpinn.arrays import Bool, Float64, Index

SAME_TIME = 1e-6  # relative difference of times that are one
STEEP = 2.0  # slope of the line from which it has no single height within a cell


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
    for k, now in points_of(t, line_t):
        order = np.argsort(line_along[now], kind="stable")
        points = line_along[now][order], line_up[now][order]
        height[k] = np.interp(along, *points, left=np.nan, right=np.nan)
    return height


def folded(
    t: Float64, along: Float64, line_t: Float64, line_along: Float64, line_up: Float64
) -> Bool:
    """Where the line is vertical or folds: its points within a column differ by more than `STEEP`
    columns in height [T, X]. Arguments as in `line_heights`."""
    found = np.zeros((len(t), len(along)), bool)
    limit = STEEP * float(np.median(np.diff(along)))
    for k, now in points_of(t, line_t):
        column = np.searchsorted((along[1:] + along[:-1]) / 2, line_along[now])
        low, high = np.full(along.size, np.inf), np.full(along.size, -np.inf)
        np.minimum.at(low, column, line_up[now])
        np.maximum.at(high, column, line_up[now])
        found[k] = high - low > limit
    return found


def points_of(t: Float64, line_t: Float64) -> Iterator[tuple[int, Index]]:
    """The frames that have a line, and the indices of its points (`line_heights`)."""
    frame = np.searchsorted((t[1:] + t[:-1]) / 2, line_t)
    order = np.argsort(frame, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(frame[order])) + 1) if order.size else ():
        k, times = int(frame[own[0]]), line_t[own]
        nearest = times[np.argmin(np.abs(times - t[k]))]
        yield k, own[np.isclose(times, nearest, rtol=SAME_TIME, atol=0.0)]
