"""Friction of side walls in the momentum balance."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.flow import WALL_GAP
from granpinn.physics.side_walls import AT_REST, coefficient


def side_walls(
    flow: Flow, friction: float, u: Float64, v: Float64
) -> tuple[Float64, Float64] | None:
    """k v/|v| along x and y [K, Y, X]; times -p it is the force (granpinn/physics/side_walls.py).

    None for a flow that states no distance of side walls, or for smooth ones.

    Args:
        friction: mu_w.
        u, v: velocity [K, Y, X] in the units of the file.
    """
    gap = flow.stated(WALL_GAP)
    if gap is None or friction == 0:
        return None
    smallest = AT_REST * np.sqrt(np.mean(u**2 + v**2))
    speed = np.maximum(np.sqrt(u**2 + v**2 + smallest**2), np.finfo(float).tiny)
    k = coefficient(friction, gap)
    return k * u / speed, k * v / speed
