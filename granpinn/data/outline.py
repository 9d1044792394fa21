"""The upper edge of the grains, which stands for the free surface at level V0."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Bool, Float64, Index
from granpinn.data.flow import Flow, Surface
from granpinn.data.walls import crossed, segments_of
from granpinn.physics.axes import vertical_coordinate


def outline(flow: Flow) -> Surface:
    """The upper edge of the grains, half way between the highest grain point and the one above it.

    It has one point for every time and place along the ground, with an error up to the spacing. A
    point that stands for a cell of a solver (the file states `grid_spacing_of_solver`) holds grains
    only if all of the cell does, so that the edge is half a cell higher on average. Grains at the
    upper edge of the grid are left out, because nothing is known above them; and so are grains with
    a wall less than two cells above them.
    """
    coordinate, downwards = vertical_coordinate(flow.gravity)
    upright = bool(coordinate)
    grains, up, along = flow.material, flow.y, flow.x
    if not upright:
        grains, up, along = grains.swapaxes(1, 2), flow.x, flow.y
    if downwards:
        grains, up = grains[:, ::-1], up[::-1]
    highest = up.size - 1 - np.argmax(grains[:, ::-1], axis=1)
    frame, place = np.nonzero(grains.any(axis=1) & (highest < up.size - 1))
    k = highest[frame, place]
    free = ~_below_wall(flow, frame, along[place], (up[k], 2 * up[k + 1] - up[k]), upright)
    frame, place, k = frame[free], place[free], k[free]
    cell = flow.stated("grid_spacing_of_solver") or 0.0
    gap = up[k + 1] - up[k]  # negative where the ground is at large coordinates
    above = (gap + np.sign(gap) * np.minimum(cell, np.abs(gap))) / 2
    top, position = up[k] + above, along[place]
    x, y = (position, top) if upright else (top, position)
    return Surface(flow.t[frame], x, y)


def _below_wall(
    flow: Flow, frame: Index, along: Float64, up: tuple[Float64, Float64], upright: bool
) -> Bool:
    """Whether a wall lies between two heights at places along the ground, in frames [n]."""
    covered = np.zeros(len(frame), bool)
    if flow.walls is None:
        return covered
    segments = segments_of(flow.walls)
    low, high = (np.stack((along, h) if upright else (h, along), 1) for h in up)
    for k in np.unique(frame):
        own = frame == k
        covered[own] = crossed(low[own], high[own], segments.at(float(flow.t[k])))
    return covered
