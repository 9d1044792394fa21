"""The free surface as a height over the ground, and where it has no single height: it folds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from granpinn.arrays import Bool, Float64, Floats, Index

SAME_TIME = 1e-6  # relative difference of times that are one
STEEP = 2.0  # slope of the line from which it has no single height within a cell


def line_heights(
    t: Float64, along: Float64, line_t: Float64, line_along: Float64, line_up: Float64
) -> tuple[Float64, Bool]:
    """Height of the surface line in every frame and column, linear between its points; and where
    it is `folded`, so that it has no single height, each [T, X].

    `points_of` says which points make the line of a frame. Without points, and beyond the ends of
    the line, the height is NaN.

    Args:
        t: times of the frames [T], increasing.
        along: places of the columns along the ground [X], increasing.
        line_t, line_along, line_up: time, place and height of the points [n], in any order.
    """
    height = np.full((len(t), len(along)), np.nan)
    folds = np.zeros(height.shape, bool)
    for k, now in points_of(t, line_t):
        order = now[np.argsort(line_along[now], kind="stable")]
        points = line_along[order], line_up[order]
        height[k] = np.interp(along, *points, left=np.nan, right=np.nan)
        folds[k] = folded(along, *points)
    return height, folds


def points_of(t: Float64, line_t: Float64) -> Iterator[tuple[int, Index]]:
    """Every frame that has a line, and the indices of its points.

    Points belong to the frame nearest in time. A frame has the line of the time nearest to its own
    among them.
    """
    frame = np.searchsorted((t[1:] + t[:-1]) / 2, line_t)
    for k, time in enumerate(t):
        own = np.flatnonzero(frame == k)
        if own.size:
            times = line_t[own]
            nearest = times[np.argmin(np.abs(times - time))]
            yield k, own[np.isclose(times, nearest, rtol=SAME_TIME, atol=0.0)]


def folded(along: Float64, line_along: Floats, line_up: Floats) -> Bool:
    """Columns of cells in which the points of a line differ by more than `STEEP` cells in height.

    The points have no order, as in a flow file.

    Args:
        along: places of the columns along the ground [X], increasing.
        line_along, line_up: points of the line at one time [n].

    Returns:
        [X].
    """
    middle = (along[1:] + along[:-1]) / 2
    column = np.searchsorted(middle, line_along)
    low, high = np.full(along.size, np.inf), np.full(along.size, -np.inf)
    np.minimum.at(low, column, line_up)
    np.maximum.at(high, column, line_up)
    return np.asarray(high - low > STEEP * float(np.median(np.diff(along))))
