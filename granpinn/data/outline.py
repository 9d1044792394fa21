"""The free surface of a level of information, and partly filled cells under it.

At level V0 the surface is the upper edge of the grains. A height that was read off a grid is known
to its spacing. Where the surface is smooth, a plane through the heights of a few frames and columns
is several times as exact.

Near the surface a cell of a measurement, or of a mean over grains, is filled in part (c < 1). Its
vector is the mean velocity of the grains in it, as real as any other. Without these vectors neither
data nor equations hold between the last full cells and the surface, and the pressure below is too
low (bench/studies/grains/note.md). A partly filled cell of a solver is another thing: its velocity
is that of a mixture with air.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64, Index
from granpinn.data.flow import SOLVER_CELL, Flow, FlowFileError, Surface
from granpinn.data.large import chosen
from granpinn.data.surface import folded, line_heights, points_of
from granpinn.data.walls import Segments, crossed, segments_of

NO_ROW = -1
# In the toe the layer is thinner than this many grains, and p = 0 does not hold. A flow with
# periodic sides has no toe.
TOE_GRAINS = 2.0


def surface_of(flow: Flow, level: str) -> Surface:
    """The points of the free surface that a level uses: after the start and above the toe.

    Raises:
        FlowFileError: there are none.
    """
    surface = outline(flow) if level == "V0" else flow.surface
    if surface is None:
        raise FlowFileError(
            f"level {level} needs the free surface, got no surface_t, surface_x, surface_y: add "
            "them or use level V0; a flow without any free surface needs a wall with wall_p there"
        )
    if level == "V2" and surface.p is None:
        raise FlowFileError(
            "level V2 needs the pressure on the free surface, got no surface_p: add it or use "
            "level V1"
        )
    kept = flow.after_start(surface.t)
    if level != "V2" and surface.t.size and not flow.periodic:
        h = flow.height(surface.x, surface.y)
        kept &= h > h.min() + TOE_GRAINS * flow.grain_diameter
    if not kept.any() and level != "V0":
        raise FlowFileError(
            f"level {level} needs points of the free surface at t > 0 and more than "
            f"{TOE_GRAINS:g} grain diameters above the lowest of them, got none: add more of "
            "the surface or use level V0"
        )
    return chosen(surface, kept)


def outline(flow: Flow) -> Surface:
    """The upper edge of the grains, with one point for every time and place along the ground."""
    return _outline_above(_highest_rows(flow), flow)


def _highest_rows(flow: Flow) -> Index:
    """The highest row of grains at every time and place along the ground [T, X]; -1: none.

    Grains at the upper edge of the grid are left out, because nothing is known above them; and so
    are grains with a wall less than two cells above them.
    """
    grains, y = flow.material, flow.y
    rows: Index = y.size - 1 - np.argmax(grains[:, ::-1], axis=1)
    rows[~grains.any(axis=1) | (rows == y.size - 1)] = NO_ROW
    if flow.walls is None:
        return rows
    frame, place = np.nonzero(rows != NO_ROW)
    k, x, segments = rows[frame, place], flow.x[place], segments_of(flow.walls)
    low, high = (np.stack((x, h), 1) for h in (y[k], 2 * y[k + 1] - y[k]))
    covered = crossed(low, high, segments)
    rows[frame[covered], place[covered]] = NO_ROW
    return rows


def _outline_above(rows: Index, flow: Flow) -> Surface:
    """The upper edge of the grains above their highest rows [T, X].

    The vectors of the flow are not read. The edge lies half way between the highest grain point and
    the one above it, to half a spacing. Local planes make it more exact. Without
    them, the pressure would be too low: an edge below the surface holds p = 0 among grains, an edge
    above it does not raise p. For the same reason places without a plane are left out, such as the
    steep sides of a column.

    A point that stands for a cell of a solver (the file states `grid_spacing_of_solver`) holds
    grains only if all of the cell does, up to its upper corner: on average the edge is half a cell
    higher, and on a slope another half of what it rises over a cell.
    """
    gap = np.diff(flow.y)[rows]
    half_way = np.where(rows != NO_ROW, flow.y[rows] + gap / 2, np.nan)
    heights, rise = smoothed(half_way, gap)
    if flow.x.size > 1:
        rise /= np.gradient(flow.x)
    cell = flow.stated(SOLVER_CELL) or 0.0
    heights += np.minimum(cell, gap) / 2 * (1 + np.abs(rise))
    frame, place = np.nonzero(np.isfinite(heights))
    return Surface(flow.t[frame], flow.x[place], heights[frame, place])


RADII = (2, 1)  # of the windows, in frames and columns; the larger one first
LEAST = 0.5  # of the places of a window that must have a height
LARGEST = 0.75  # residual of a plane, in spacings: half for the grid, the rest for curvature
_ROUNDING = 1 + 1e-6  # on the limit, which residuals of a grid often meet exactly
_RIDGE = 1e-9  # a window of one frame, or of one column, leaves a slope of 0


def smoothed(heights: Float64, spacing: Float64) -> tuple[Float64, Float64]:
    """Heights on local planes, and the slopes of these planes per column; NaN: no plane.

    The plane of a place is the least squares fit to the heights of a window around it. It must miss
    none of them by more than `LARGEST` spacings; where the map is rougher, by more than the median
    of the places does. Steps have none. A map whose heights all lack neighbors stays as it is.

    Args:
        heights: one for every frame and column [T, X]; NaN: none.
        spacing: of the grid at every height, positive [T, X].
    """
    planes = [_planes(heights, radius) for radius in RADII]
    misses = np.min([farthest / spacing for _, _, farthest in planes], axis=0)
    misses = misses[np.isfinite(misses)]
    if not misses.size:
        return heights.copy(), np.where(np.isfinite(heights), 0.0, np.nan)
    most = max(LARGEST, float(np.median(misses)))
    found, slope = np.full_like(heights, np.nan), np.full_like(heights, np.nan)
    for height, rise, farthest in planes:
        near = np.isnan(found) & (farthest <= most * _ROUNDING * spacing)
        found[near], slope[near] = height[near], rise[near]
    return found, slope


def _planes(heights: Float64, radius: int) -> tuple[Float64, Float64, Float64]:
    """Height and slope of the plane of every place, and its largest residual; infinite: none."""
    moments, right = np.zeros((*heights.shape, 3, 3)), np.zeros((*heights.shape, 3))
    for place, rise in _neighbors(heights, radius):
        seen = np.isfinite(rise)
        moments += seen[..., None, None] * np.outer(place, place)
        right += np.where(seen, rise, 0.0)[..., None] * place
    plane = np.asarray(np.linalg.solve(moments + _RIDGE * np.eye(3), right[..., None]))[..., 0]
    farthest = np.zeros(heights.shape)
    for place, rise in _neighbors(heights, radius):
        np.fmax(farthest, np.abs(rise - plane @ place), out=farthest)
    whole = np.multiply.outer(*(_within(size, radius) for size in heights.shape))
    farthest[moments[..., 0, 0] < np.maximum(1, LEAST * whole)] = np.inf
    return heights + plane[..., 0], plane[..., 2], farthest


def _within(size: int, radius: int) -> Index:
    """The number of places within a radius of each of `size` places in a line [size]."""
    i = np.arange(size)
    return np.asarray(np.minimum(i + radius, size - 1) - np.maximum(i - radius, 0) + 1)


def _neighbors(heights: Float64, radius: int) -> Iterator[tuple[Float64, Float64]]:
    """Places (1, frames, columns) in a window, and how much higher each place has its neighbor.

    NaN: one of both has no height, or the neighbor lies beyond the edges of the map.
    """
    T, X = heights.shape
    padded = np.pad(heights, radius, constant_values=np.nan)
    for i, j in product(range(2 * radius + 1), repeat=2):
        rise = padded[i : i + T, j : j + X] - heights
        yield np.array([1.0, i - radius, j - radius]), rise


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
    nearest = line[scipy.spatial.cKDTree(line).query(cells)[1]]
    inside = grains[scipy.spatial.cKDTree(grains).query(cells)[1]] - nearest
    return np.asarray(np.sum((cells - nearest) * inside, axis=-1) > 0)


def _behind(flow: Flow, segments: Segments, partial: Bool) -> Bool:
    """Cells of `partial` [T, Y, X] from which a wall hides the nearest full cell."""
    frame, row, column = cells = np.nonzero(partial)
    here, nearest = _places(flow, row, column), np.full((len(row), 2), np.nan)
    edges = np.searchsorted(frame, np.arange(flow.t.size + 1))
    for k in np.flatnonzero(np.diff(edges)):
        full, own = _places(flow, *np.nonzero(flow.c[k] >= 1)), slice(edges[k], edges[k + 1])
        if len(full):
            nearest[own] = full[scipy.spatial.cKDTree(full).query(here[own])[1]]
    behind = np.zeros_like(partial)
    behind[cells] = crossed(here, nearest, segments)
    return behind


def _places(flow: Flow, row: Index, column: Index) -> Float64:
    """x, y of the centers of cells [n, 2]."""
    return np.stack([flow.x[column], flow.y[row]], 1)
