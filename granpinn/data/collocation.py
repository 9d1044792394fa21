"""Collocation points, where equations count and no vector is: between vectors, and above them.

**Between the vectors of a grid**, at random places and times. With residuals at the vectors alone,
the network overfits the equations there. There are no points between the lowest two rows. The shear
layer over the ground is often thinner than one row, and no vector lies in it: residuals there would
fit the law to an arbitrary layer (bench/studies/collocation). Tracked particles need no such
points, since their vectors are at random places.

**In the strip between the highest vectors and the free surface.** No measurement has vectors up to
the surface. Where no equation holds in this strip, the pressure is zero at the line but rises too
little below it: the weight of the strip is missing at every depth (bench/studies/grains/note.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64, Floats, Index
from granpinn.data.flow import Flow
from granpinn.data.scaling import RESOLUTION, unplaced
from granpinn.data.surface import SAME_TIME, points_of
from granpinn.data.walls import Segments, crossed, segments_of
from granpinn.physics.scales import Scales

# Of Philox; the same points for every seed, so that the members of an ensemble share them.
_KEY = 3 << 64


def above_ground(flow: Flow) -> Bool:
    """Cells full of grains that count, without their lowest row [T, Y, X]."""
    grains: Bool = flow.material & flow.after_start(flow.t)[:, None, None]
    rows = np.flatnonzero(grains.any(axis=(0, 2)))
    grains[:, rows[:1]] = False
    return grains


def points_between(flow: Flow, count: int) -> tuple[Float64, Float64, Float64]:
    """Random x, y, t [count], in the units of the file; no points if no cell is complete.

    A complete cell, in space and time, has its eight corners at grid points `above_ground`, with a
    vector or without; four corners in a flow of one frame. No wall passes through it. The
    points are uniform over all complete cells.
    """
    complete = _complete(flow)
    if flow.walls is not None:
        complete &= ~_cut(flow, segments_of(flow.walls))
    cells = np.argwhere(complete)
    rng = np.random.Generator(np.random.Philox(key=_KEY))
    drawn = cells[rng.integers(len(cells), size=count)] if len(cells) else cells
    part = rng.random(drawn.shape)

    def within(edges: Floats, axis: int) -> Float64:
        values, k = edges.astype(np.float64), drawn[:, axis]
        if values.size == 1:
            return values[k]
        return np.asarray(values[k] + part[:, axis] * (values[k + 1] - values[k]))

    return within(flow.x, 2), within(flow.y, 1), within(flow.t, 0)


def _cut(flow: Flow, segments: Segments) -> Bool:
    """Cells between the grid points through which a wall passes: [Y - 1, X - 1].

    A wall that passes through a cell separates two of its corners.
    """
    y, x = np.meshgrid(flow.y, flow.x, indexing="ij")
    place = np.stack([x, y], -1)
    shape = len(y) - 1, x.shape[1] - 1
    corners = [place[a:, b:][: shape[0], : shape[1]] for a in (0, 1) for b in (0, 1)]
    pairs = [(a.reshape(-1, 2), b.reshape(-1, 2)) for a, b in combinations(corners, 2)]
    cut = np.any([crossed(a, b, segments) for a, b in pairs], axis=0)
    return np.asarray(cut.reshape(shape))


def lie_between(flow: Flow, x: Float64, y: Float64, t: Float64) -> Bool:
    """Whether points, in the units of the file, lie in complete cells [n]."""
    places = (_cell(flow.t, t), _cell(flow.y, y), _cell(flow.x, x))
    return np.asarray(_complete(flow)[places])


def _complete(flow: Flow) -> Bool:
    """Cells with all corners `above_ground` [T, Y, X]: one less along each axis with a step."""
    complete = above_ground(flow)
    for axis in range(3) if flow.t.size > 1 else (1, 2):
        complete = np.delete(complete, -1, axis) & np.delete(complete, 0, axis)
    return complete


def _cell(edges: Floats, values: Float64) -> Index:
    """Number of the cell between edges that holds each value."""
    last = max(edges.size - 2, 0)
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, last)


# Weight per area over that between the vectors. No vector holds the velocity in the strip: with as
# much weight as elsewhere the network changes it there (bench/studies/grains/note.md).
DENSITY = 0.25
# Few of its points make most of the scatter of a batch, as the pressure falls to zero there. So it
# has so many times more points, each with so much less weight, but no more than this part of all
# others (bench/studies/collocation/note.md).
FINER, LARGEST_PART = 24, 0.5
THICKEST = 2.5  # spacings; a wider strip is a gap in the data
_STRIP_KEY = 4 << 64  # of Philox; the same points for every seed


class Strip(NamedTuple):
    """The strip below each of M points of the surface.

    Attributes:
        surface: (x, y, t) of the points [M, 3].
        nearest: (x, y) of the vectors nearest to them [M, 2], NaN where there is none.
        area: of the strip, in cells of the grid [M].
    """

    surface: Float64
    nearest: Float64
    area: Float64


def strip_of(points: Float64, surface: Float64, flow: Flow, scales: Scales) -> Strip:
    """The strip between vectors and a surface, (x, y, t) of the training [N, 3] and [M, 3].

    Its points lie between a point of the surface and the vector nearest to it at the same time,
    with no wall between both.
    """
    dx, dy = (step / scales.length for step in flow.spacing)
    thickest = THICKEST * max(dx, dy)
    # Points that repeat share the width of their place.
    places, place, count = np.unique(surface, axis=0, return_inverse=True, return_counts=True)
    nearest, width = _below(points, places, thickest, flow.steady)
    nearest, width = nearest[place], (width / count)[place]
    depth = np.hypot(*(surface[:, :2] - nearest).T)
    depth = np.where(depth <= thickest, depth, 0.0)  # NaN: no vector at this time
    if flow.walls is not None:
        ends = surface, np.column_stack([nearest, surface[:, 2]])
        start, end = (unplaced(points, flow, scales)[:, :2] for points in ends)
        depth[crossed(start, end, segments_of(flow.walls))] = 0.0
    return Strip(surface, nearest, depth * np.minimum(width, thickest) / (dx * dy))


def drawn(strips: Sequence[Strip], between: int, vectors: int) -> list[tuple[Float64, Float64]]:
    """Points (x, y, t) [S, 3] of strips, uniform over their mean, and the weight of the equations
    at each [S].

    A point lies on the same part of the way from a vector to a point of the surface in all strips;
    on the surface where a strip has no area.

    Args:
        between, vectors: numbers of points between the vectors, and of vectors.
    """
    areas = [strip.area for strip in strips]
    mean = np.mean(areas, axis=0)
    weight = DENSITY * between / vectors * float(mean.sum())
    count = round(min(FINER * weight, LARGEST_PART * (between + vectors)))
    rng = np.random.Generator(np.random.Philox(key=_STRIP_KEY))
    place = (
        rng.choice(len(mean), size=count, p=mean / mean.sum()) if count else np.empty(0, np.intp)
    )
    part = rng.random((count, 1))
    found = []
    for strip in strips:
        points = strip.surface[place]  # a copy
        nearest = np.where(strip.area[place, None] > 0, strip.nearest[place], points[:, :2])
        points[:, :2] = nearest + part * (points[:, :2] - nearest)
        points = np.rint(points / RESOLUTION) * RESOLUTION
        found.append((points, weight / max(count, 1) * (strip.area / mean.clip(1e-12))[place]))
    return found


def _below(
    points: Float64, surface: Float64, farthest: float, steady: bool
) -> tuple[Float64, Float64]:
    """The vector nearest to each point of the surface [M, 2], and the width that it stands for [M].

    The width is the mean distance to its two neighbors on the surface. NaN and 0 at times without
    vectors, or where all are farther away.

    Args:
        points, surface: (x, y, t) of the vectors [N, 3], in the order of t, and of the surface
            [M, 3].
        steady: the time of a vector does not matter.
    """
    nearest, width = np.full((len(surface), 2), np.nan), np.zeros(len(surface))
    times, first = np.unique(points[:, 2], return_index=True)
    ends = [*first, len(points)]
    for k, here in points_of(np.unique(surface[:, 2]) if steady else times, surface[:, 2]):
        t = float(surface[here[0], 2])
        if not steady and abs(times[k] - t) > SAME_TIME * max(abs(t), 1.0):
            continue
        now = slice(None) if steady else slice(ends[k], ends[k + 1])
        vectors = points[now, :2]
        distance, index = scipy.spatial.cKDTree(vectors).query(
            surface[here, :2], distance_upper_bound=farthest
        )
        found = np.isfinite(distance)
        nearest[here[found]] = vectors[index[found]]
        if len(here) > 2:
            gaps, _ = scipy.spatial.cKDTree(surface[here, :2]).query(surface[here, :2], k=3)
            width[here] = gaps[:, 1:].mean(axis=1)
    return nearest, width
