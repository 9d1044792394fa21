"""A plate on the grains in place of a free surface: its pressure and shear stress are measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.walls import segments_of

LEVEL = 0.02  # largest slope of a plate


@dataclass(frozen=True)
class Plate:
    """The lower face of a plate in upright axes, and the stress on it; units of the file."""

    height: float
    p: float
    tau: float


def plate_on(flow: Flow, ends: Float64, top: float) -> Plate | None:
    """The plate above the grains of a flow with periodic sides; None if there is none.

    Args:
        ends: of the segments of its walls in upright axes [K, 2, 2].
        top: height of the highest cell of grains there.
    """
    if flow.walls is None:
        return None
    walls = segments_of(flow.walls)
    along = np.abs(ends[:, 1] - ends[:, 0])
    known = np.isfinite(walls.p).all(axis=1) & np.isfinite(walls.tau).all(axis=1)
    known &= (along[:, 1] <= LEVEL * along[:, 0]) & (ends[:, :, 1].min(axis=1) > top)
    if not known.any():
        return None
    weight = along[known, 0]
    mean = [
        float(np.average(a[known].mean(axis=1), weights=weight))
        for a in (ends[:, :, 1], walls.p, walls.tau)
    ]
    return Plate(*mean)
