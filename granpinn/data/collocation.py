"""Collocation points between the measured vectors of a grid, at random places and times.

With residuals at the vectors alone, the network overfits the equations there. There are no points
between the lowest two rows. The shear layer over the ground is often thinner than one row, and no
vector lies in it: residuals there would fit the law to an arbitrary layer
(bench/studies/collocation).

Tracked particles need no such points, since their vectors are at random places.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from granpinn.arrays import Bool, Float64, Floats, Index
from granpinn.data.flow import Flow
from granpinn.data.large import slabs
from granpinn.data.walls import Segments, crossed, segments_of

# Of Philox; the same points for every seed, so that the members of an ensemble share them.
_KEY = 3 << 64


def above_ground(flow: Flow, lowest: int | None = None) -> Bool:
    """Cells full of grains that count, without their lowest row [T, Y, X].

    Args:
        lowest: the lowest row of the flow of which this is a part.
    """
    grains: Bool = flow.material & flow.after_start(flow.t)[:, None, None]
    rows = [row for row in (lowest_row(flow), lowest) if row is not None]
    if rows:
        grains[:, min(rows)] = False
    return grains


def lowest_row(flow: Flow) -> int | None:
    """The lowest row of cells full of grains that count."""
    lowest = []
    for part in slabs(flow):
        grains = (flow.c[part] >= 1) & flow.after_start(flow.t[part])[:, None, None]
        lowest.append(np.flatnonzero(grains.any(axis=(0, 2))))
    rows = np.concatenate(lowest)
    return int(rows.min()) if rows.size else None


def points_between(
    flow: Flow, grains: Bool, count: int, number: int = 0
) -> tuple[Float64, Float64, Float64]:
    """Random x, y, t [count], in the units of the file; no points if no cell is complete.

    A complete cell, in space and time, has its eight corners at grid points in `grains` [T, Y, X],
    with a vector or without; four corners in a flow of one frame. No wall passes through it. The
    points are uniform over all complete cells. Each part of a large flow has random numbers of
    its own, by its `number`.
    """
    complete = _complete(flow, grains)
    if flow.walls is not None:
        complete &= ~_cut(flow, segments_of(flow.walls))
    cells = np.argwhere(complete)
    rng = np.random.Generator(np.random.Philox(key=_KEY + number))
    drawn = cells[rng.integers(len(cells), size=count)] if len(cells) else cells
    part = rng.random(drawn.shape)

    def within(edges: Floats, axis: int) -> Float64:
        values, k = edges.astype(np.float64), drawn[:, axis]
        if values.size == 1:
            return values[k]
        return np.asarray(values[k] + part[:, axis] * (values[k + 1] - values[k]))

    return within(flow.x, 2), within(flow.y, 1), within(flow.t, 0)


def _cut(flow: Flow, segments: Segments) -> Bool:
    """Cells between the grid points through which a wall passes: [T - 1, Y - 1, X - 1].

    A wall that passes through a cell separates two of its corners. In a flow of one frame the first
    axis has one element.
    """
    y, x = np.meshgrid(flow.y, flow.x, indexing="ij")
    place = np.stack([x, y], -1)
    shape = len(y) - 1, x.shape[1] - 1
    corners = [place[a:, b:][: shape[0], : shape[1]] for a in (0, 1) for b in (0, 1)]
    pairs = [(a.reshape(-1, 2), b.reshape(-1, 2)) for a, b in combinations(corners, 2)]
    cut = np.empty((flow.t.size, *shape), bool)
    for k, there in segments.spells(flow.t):
        cut[k] = np.any([crossed(a, b, there) for a, b in pairs], axis=0).reshape(shape)
    return cut if len(cut) == 1 else cut[1:] | cut[:-1]


def lie_between(flow: Flow, grains: Bool, x: Float64, y: Float64, t: Float64) -> Bool:
    """Whether points, in the units of the file, lie in complete cells of `grains` [n]."""
    places = (_cell(flow.t, t), _cell(flow.y, y), _cell(flow.x, x))
    return np.asarray(_complete(flow, grains)[places])


def _complete(flow: Flow, grains: Bool) -> Bool:
    """Cells with all corners in `grains` [T, Y, X]: one less along each axis with a step."""
    complete = grains
    for axis in range(3) if flow.t.size > 1 else (1, 2):
        complete = np.delete(complete, -1, axis) & np.delete(complete, 0, axis)
    return complete


def _cell(edges: Floats, values: Float64) -> Index:
    """Number of the cell between edges that holds each value."""
    last = max(edges.size - 2, 0)
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, last)
