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

from granpinn.arrays import Bool
from granpinn.data.flow import Flow, Surface
from granpinn.data.surface_line import line_heights
from granpinn.physics.axes import vertical_coordinate

FILLED = 0.5  # least c of a cell that counts where there is no surface line


def with_partial_cells(flow: Flow) -> Flow:
    """The flow with c = 1 in its partly filled cells that have a vector and lie below the surface.

    The surface is the line of the flow; without a line, such cells have c >= 0.5. Scattered vectors
    and flows of a solver (the file states `grid_spacing_of_solver`) stay as they are.
    """
    if flow.particles is not None or flow.stated("grid_spacing_of_solver") is not None:
        return flow
    partial = (flow.c > 0) & (flow.c < 1) & np.isfinite(flow.u) & np.isfinite(flow.v)
    below = flow.c >= FILLED if flow.surface is None else _below(flow, flow.surface)
    c = np.where(partial & below, np.ones_like(flow.c), flow.c)
    return replace(flow, c=c)


def _below(flow: Flow, surface: Surface) -> Bool:
    """Cells whose center lies below the line, and between its ends [T, Y, X]."""
    upright, downwards = vertical_coordinate(flow.gravity)
    up, along = (flow.y, flow.x) if upright else (flow.x, flow.y)
    line_up, line_along = (surface.y, surface.x) if upright else (surface.x, surface.y)
    height = line_heights(flow.t, along, surface.t, line_along, line_up)[:, None]
    found = (up[:, None] > height) if downwards else (up[:, None] < height)
    return found if upright else found.swapaxes(1, 2)
