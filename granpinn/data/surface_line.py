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
    limit = STEEP * float(np.median(np.diff(along)))
    point, edges = _by_frame(t, line_t)
    frame = np.repeat(np.arange(len(t)), np.diff(edges))
    column = np.searchsorted((along[1:] + along[:-1]) / 2, line_along[point])
    low, high = np.full((len(t), len(along)), np.inf), np.full((len(t), len(along)), -np.inf)
    np.minimum.at(low, (frame, column), line_up[point])
    np.maximum.at(high, (frame, column), line_up[point])
    steep: Bool = high - low > limit
    return steep


def points_of(t: Float64, line_t: Float64) -> Iterator[tuple[int, Index]]:
    """The frames that have a line, and the numbers of its points [k] (`line_heights`)."""
    point, edges = _by_frame(t, line_t)
    for k in np.flatnonzero(np.diff(edges)):
        yield int(k), point[edges[k] : edges[k + 1]]


def _by_frame(t: Float64, line_t: Float64) -> tuple[Index, Index]:
    """The points of all lines, frame by frame, and where the frames begin among them [T + 1]."""
    frame = np.searchsorted((t[1:] + t[:-1]) / 2, line_t)
    gap = np.abs(line_t - t[frame])
    order = np.lexsort((gap, frame))
    nearest = np.full(len(t), np.nan)
    first = order[np.unique(frame[order], return_index=True)[1]]
    nearest[frame[first]] = line_t[first]
    same = np.abs(line_t - nearest[frame]) <= SAME_TIME * np.abs(nearest[frame])
    point = np.flatnonzero(same)
    point = point[np.argsort(frame[point], kind="stable")]
    return point, np.searchsorted(frame[point], np.arange(len(t) + 1))
