"""Points of the free surface: where the volume fraction crosses 1/2.

Between the centers of two neighboring cells, one in the grains and one outside, the surface lies
where c = 1/2 by linear interpolation; for a mask, half way. Some edges of a mask are no free
surface: the bed and the side walls are edges too. An edge counts if it faces up (against
gravity), or if it faces sideways and has grains beyond it at another time. An edge that faces down
never counts.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import binary_erosion

from granpinn.arrays import Float64
from granpinn.data.flow import Surface
from granpinn.importers.vectors import VectorFields

HALF = 0.5
_UPWARDS = 0.5  # cosine of the angle to the vertical
NEAR = 0.1  # of 1/2: scattered cells that the surface cuts through


def from_fraction(
    c: Float64, t: Float64, y: Float64, x: Float64, gravity: tuple[float, float], jitter: int = 0
) -> Surface | None:
    """The free surface of a volume fraction [T, Y, X]; None if there is none.

    Args:
        jitter: cells by which the edge of the grains moves along a wall at rest.
    """
    g = math.hypot(*gravity)
    up = {1: -gravity[1] / g, 2: -gravity[0] / g}  # cosine of each axis with the vertical
    ever = (c > HALF).any(axis=0)
    if jitter:
        ever = binary_erosion(ever, iterations=jitter, border_value=1)
    points = []
    for axis, coordinate in ((1, y), (2, x)):
        low = np.moveaxis(c, axis, 0)[:-1]
        high = np.moveaxis(c, axis, 0)[1:]
        for grains_below in (True, False):
            inner, outer = (low, high) if grains_below else (high, low)
            cosine = up[axis] if grains_below else -up[axis]
            crossing = (inner > HALF) & (outer <= HALF)
            if cosine < -_UPWARDS:
                continue
            if cosine < _UPWARDS:
                seen = np.moveaxis(np.broadcast_to(ever, c.shape), axis, 0)
                crossing &= seen[1:] if grains_below else seen[:-1]
            place = np.nonzero(crossing)
            share = (HALF - low[place]) / (high[place] - low[place])
            along = coordinate[place[0]] + share * np.diff(coordinate)[place[0]]
            # After moveaxis the other axes keep their order: (frame, column) or (frame, row).
            other = (x if axis == 1 else y)[place[2]]
            pair = (other, along) if axis == 1 else (along, other)
            points.append(np.stack([t[place[1]], *pair]))
    found = np.concatenate(points, axis=1)
    if found.shape[1] == 0:
        return None
    found = found[:, np.lexsort((found[2], found[1], found[0]))]
    return Surface(t=found[0], x=found[1], y=found[2])


def from_scattered(fields: VectorFields) -> Surface | None:
    """Points of scattered cells that are about half full."""
    if fields.c is None:
        return None
    near = np.abs(fields.c - HALF) < NEAR
    if not near.any():
        return None
    return Surface(t=fields.t[near], x=fields.x[near], y=fields.y[near])
