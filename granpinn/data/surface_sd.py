"""How well the free surface of a flow is known: the standard deviation of one offset of its line.

An offset is a distance along the outward normal, the same for the whole line. In this order:

- **Stated.** The file says it (`surface_sd`, 0 for an exact line).
- **A solver.** The surface is sharp and known to half a cell of the solver; errors of this size are
  in the error model, so the standard deviation is 0. It is the distance between
  the line and the place where c falls through 1/2, if that distance is larger.
- **Grains.** A surface of grains is defined to half a grain. The same distance counts if it is
  larger. Where c is a mask (0 or 1), the line may lie anywhere between two rows of vectors: half a
  spacing counts.

Level V0 has no line but the outline of the data. It may lie anywhere between two rows, whatever the
file says about a line.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates

from granpinn.arrays import Float64, Floats, Index
from granpinn.data.flow import SOLVER_CELL, SURFACE_SD, Flow, Surface
from granpinn.data.surface_offset import outward_normals
from granpinn.physics.axes import vertical_coordinate

HALF = 0.5  # of c at the surface, of a grain, of a spacing
REACH, STEP = 2.0, 0.25  # of the profile of c across the line, in spacings


def surface_sd(flow: Flow, level: str) -> float:
    """The standard deviation of the offset of the surface of a level, in the unit of length.

    Args:
        flow: as in its file, before partly filled cells count as full.
    """
    grain, cell = flow.grain_diameter, flow.stated(SOLVER_CELL)
    between_rows = 0.0 if flow.particles is not None else HALF * spacing(flow)
    if level == "V0" or flow.surface is None:
        return 0.0 if cell is not None else max(HALF * grain, between_rows)
    if SURFACE_SD in flow.attributes:
        return float(flow.attributes[SURFACE_SD])
    if flow.particles is not None:
        return HALF * grain
    distance = from_fraction(flow, flow.surface)
    if cell is not None:
        return distance if distance > HALF * cell else 0.0
    mask = _share_of_fractions(flow, flow.surface) < HALF
    return max(HALF * grain, distance, between_rows if mask else 0.0)


def from_fraction(flow: Flow, surface: Surface) -> float:
    """Distance of the line from the place where c falls through 1/2, at most `REACH` spacings.

    c is averaged over the line at every distance from it, so errors of single points cancel.
    """
    h = spacing(flow)
    normals = outward_normals(flow, surface)
    across = np.arange(-REACH, REACH + STEP / 2, STEP)
    frame = _frames(flow, surface)
    profile = np.array([_c_at(flow, frame, surface, a * h * normals).mean() for a in across])
    falling = np.minimum.accumulate(profile)
    return abs(float(np.interp(HALF, falling[::-1], across[::-1]))) * h


def spacing(flow: Flow) -> float:
    """Distance of the vectors of a grid along the coordinate nearer to the vertical."""
    axis = flow.x if vertical_coordinate(flow.gravity)[0] == 0 else flow.y
    return float(np.median(np.diff(axis)))


def _share_of_fractions(flow: Flow, surface: Surface) -> float:
    """Share of the points of the line whose nearest cell is filled in part."""
    nowhere = np.zeros((surface.t.size, 2))
    c = _c_at(flow, _frames(flow, surface), surface, nowhere, order=0)
    return float(np.mean((c > 0) & (c < 1)))


def _frames(flow: Flow, surface: Surface) -> Index:
    """The frame nearest to each point of the line [n]."""
    times, place = np.unique(surface.t, return_inverse=True)
    return np.asarray(np.abs(flow.t - times[:, None]).argmin(axis=1)[place])


def _c_at(flow: Flow, frame: Index, surface: Surface, shift: Float64, order: int = 1) -> Floats:
    """c at the points of the line after a shift [n, 2]; order 1: linear, 0: of the nearest cell."""
    row = np.interp(surface.y + shift[:, 1], flow.y, np.arange(flow.y.size))
    column = np.interp(surface.x + shift[:, 0], flow.x, np.arange(flow.x.size))
    places = np.stack([frame, row, column])
    found: Floats = map_coordinates(flow.c, places, order=order, mode="nearest")
    return found
