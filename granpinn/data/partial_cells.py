"""Partly filled cells under the free surface: their vectors are those of grains.

Near the surface a cell of a measurement, or of a mean over grains, is filled in part (c < 1). Its
vector is the mean velocity of the grains in it, as real as any other. Without these vectors neither
data nor equations hold between the last full cells and the surface, and the pressure below is too
low (bench/studies/grains/note.md).

A partly filled cell of a solver is another thing: its velocity is that of a mixture with air.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from granpinn.arrays import Bool, Float64, Index
from granpinn.data.flow import SOLVER_CELL, Flow, Surface
from granpinn.data.surface import folded, line_heights, points_of
from granpinn.data.walls import Segments, parted, segments_of

FILLED = 0.5  # least c of a cell that counts where there is no surface line


def with_partial_cells(flow: Flow) -> Flow:
    """The flow with c = 1 in its partly filled cells that have a vector and lie below the surface.

    The surface is the line of the flow; without a line, such cells have c >= 0.5. Where the line is
    vertical or folds, those count that lie on the side of the nearest full cell. Cells behind a
    wall, as seen from the nearest full one, do not count. Scattered vectors and flows of a solver
    (the file states `grid_spacing_of_solver`) stay as they are.
    """
    if flow.particles is not None or flow.stated(SOLVER_CELL) is not None:
        return flow
    partial = (flow.c > 0) & (flow.c < 1) & np.isfinite(flow.u) & np.isfinite(flow.v)
    below = flow.c >= FILLED if flow.surface is None else _below(flow, flow.surface)
    if flow.walls is not None:
        below &= ~_behind(flow, segments_of(flow.walls), partial & below)
    c = np.where(partial & below, np.ones_like(flow.c), flow.c)
    return replace(flow, c=c)


def _below(flow: Flow, surface: Surface) -> Bool:
    """Cells whose center lies below the line, and between its ends [T, Y, X]."""
    height = line_heights(flow.t, flow.x, surface)[:, None]
    found: Bool = flow.y[:, None] < height
    steep = folded(flow.t, flow.x, surface)
    for i, now in points_of(flow.t, surface.t) if steep.any() else ():
        points = np.stack([surface.x[now], surface.y[now]], 1)
        beside = _beside(flow.x, flow.y, flow.material[i], points)
        found[i][:, steep[i]] = beside[:, steep[i]]
    return found


def _beside(along: Float64, up: Float64, full: Bool, line: Float64) -> Bool:
    """Cells on the same side of the nearest point of the line [n, 2] as the nearest full cell.

    None [Y, X] if no cell is full.
    """
    rows, columns = np.nonzero(full)
    if rows.size == 0:
        return np.zeros_like(full)
    cells = np.stack(np.broadcast_arrays(along[None, :], up[:, None]), -1)
    grains = np.stack([along[columns], up[rows]], 1)
    nearest = line[cKDTree(line).query(cells)[1]]
    inside = grains[cKDTree(grains).query(cells)[1]] - nearest
    return np.asarray(np.sum((cells - nearest) * inside, axis=-1) > 0)


def _behind(flow: Flow, segments: Segments, partial: Bool) -> Bool:
    """Cells of `partial` [T, Y, X] from which a wall hides the nearest full cell."""
    frame, row, column = cells = np.nonzero(partial)
    here, nearest = _places(flow, row, column), np.full((len(row), 2), np.nan)
    edges = np.searchsorted(frame, np.arange(flow.t.size + 1))
    for k in np.flatnonzero(np.diff(edges)):
        full, own = _places(flow, *np.nonzero(flow.c[k] >= 1)), slice(edges[k], edges[k + 1])
        if len(full):
            nearest[own] = full[cKDTree(full).query(here[own])[1]]
    behind = np.zeros_like(partial)
    behind[cells] = parted(here, nearest, segments)
    return behind


def _places(flow: Flow, row: Index, column: Index) -> Float64:
    """x, y of the centers of cells [n, 2]."""
    return np.stack([flow.x[column], flow.y[row]], 1)
