"""Walls of a flow file that the simulator of a second opinion does not have.

Its grains touch a floor at y = 0 and walls at x = 0 and at the width of the box, all at rest.
"""

from __future__ import annotations

import numpy as np

from granpinn.data import Flow
from granpinn.data.walls import segments_of

NEAR = 0.5  # spacings between a wall of the file and one of the simulator


def foreign_wall(flow: Flow, box_width: float | None) -> str | None:
    """Why the walls of a flow are not those of the simulator; None if they are, or none are stated.

    Args:
        box_width: of the box in the file, None if it states none.
    """
    if flow.walls is None:
        return None
    walls = segments_of(flow.walls)
    dx, dy = (float(np.median(np.diff(axis))) for axis in (flow.x, flow.y))
    x, y = walls.ends[..., 0], walls.ends[..., 1]
    known = (np.abs(y) <= NEAR * dy).all(axis=1)
    for place in (0.0, box_width):
        if place is not None:
            known |= (np.abs(x - place) <= NEAR * dx).all(axis=1)
    still = (walls.velocity == 0).all(axis=(1, 2))
    if bool((known & still).all()):
        return None
    name = walls.name(int(walls.wall[np.argmin(known & still)]))
    return f"the simulator does not have {name} of the file"
