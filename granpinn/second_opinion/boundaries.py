"""Walls and forces of a flow that the simulator of a second opinion does not have.

Its grains touch a floor at y = 0 and walls at x = 0 and at the width of the box, all at rest.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.walls import segments_of

NEAR = 0.5  # spacings between a wall of the file and one of the simulator


def foreign_wall(flow: Flow, box_width: float | None) -> str | None:
    """Why the walls or forces of a flow are not those of the simulator; None if they are.

    Every stated wall must be one of the simulator, and a stated floor must reach as far as the
    grains: beside it may be an opening. A flow without walls fits; one with a source term does not.

    Args:
        box_width: of the box in the file, None if it states none.
    """
    if flow.source is not None:
        return "the flow has a source of momentum, which the simulator does not have"
    if flow.walls is None:
        return None
    walls = segments_of(flow.walls)
    dx, dy = (float(np.median(np.diff(axis))) for axis in (flow.x, flow.y))
    x, y = walls.ends[..., 0], walls.ends[..., 1]
    known = (np.abs(y) <= NEAR * dy).all(axis=1)
    floor = known
    for place in (0.0, box_width):
        if place is not None:
            known = known | (np.abs(x - place) <= NEAR * dx).all(axis=1)
    still = (walls.velocity == 0).all(axis=(1, 2))
    if bool((known & still).all()):
        return _open_floor(flow, x[floor], dx, dy)
    name = walls.names()[walls.wall[np.argmin(known & still)]]
    return f"the simulator does not have {name} of the file"


def _open_floor(flow: Flow, floor: Float64, dx: float, dy: float) -> str | None:
    """Why the stated floor is not that of the simulator; None if it lies under all grains.

    Args:
        floor: x of both ends of the segments on y = 0 [n, 2].
    """
    if flow.y[0] > dy:  # the window begins above the floor
        return None
    stands = (flow.c[:, 0] >= 0.5).any(axis=0)
    near = np.sort(floor, axis=1) + np.array([-dx, dx])
    under = ((flow.x[:, None] >= near[:, 0]) & (flow.x[:, None] <= near[:, 1])).any(axis=1)
    bare = flow.x[stands & ~under]
    if not bare.size:
        return None
    return (
        f"the simulator has a floor at x = {bare[0]:.4g}, where the walls of the file leave it open"
    )
