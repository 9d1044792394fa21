"""The free surface of a level of information; at level V0 the upper edge of the grains."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Index
from granpinn.data.flow import SOLVER_CELL, Flow, FlowFileError, Surface
from granpinn.data.large import chosen
from granpinn.data.local_planes import smoothed
from granpinn.data.partial_cells import filled_slabs
from granpinn.data.walls import parted, segments_of

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
    rows = [_highest_rows(part) for _, part in filled_slabs(flow)]
    return _outline_above(np.concatenate(rows), flow)


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
    covered = parted(low, high, flow.t[frame], segments)
    rows[frame[covered], place[covered]] = NO_ROW
    return rows


def _outline_above(rows: Index, flow: Flow) -> Surface:
    """The upper edge of the grains above their highest rows [T, X].

    The vectors of the flow are not read. The edge lies half way between the highest grain point and
    the one above it, to half a spacing. Local planes make it more exact (local_planes.py). Without
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
