"""A flow on a regular grid below a surface line, for sums along the lines of y."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.data import Flow
from granpinn.data.surface import STEEP, folded, line_heights
from granpinn.data.walls import segments_of

NO_TOP = (
    "the flow has no surface line nor, with periodic sides, a plate of known pressure and shear "
    "stress, and the stress is counted from these"
)
LEVEL = 0.02  # largest slope of a plate
EVEN = 0.02  # largest relative difference of the spacings of a regular axis


class Upright(NamedTuple):
    """Vectors on a regular grid below a surface line, in units of the file.

    Attributes:
        flow: on an even grid.
        height: of the surface line in every column, [T, X]; NaN where there is no line. Without a
            line, of a plate on the grains.
        clear: columns in whose neighbourhood the line exists, is not steep and does not fold,
            [T, X].
        load: pressure and size of the shear stress at `height`; 0 on a free surface.
    """

    flow: Flow
    height: Float64
    clear: Bool
    load: tuple[float, float] = (0.0, 0.0)


def upright(flow: Flow, reach: int) -> Upright | str:
    """The flow with the height of its surface, or why the momentum balance cannot use it.

    Args:
        reach: columns on each side that the balance of a column uses.
    """
    free = flow.surface is not None and flow.surface.t.size > 0
    if not free and flow.walls is None:
        return NO_TOP
    if flow.particles is not None:
        return "the vectors are scattered, and it needs vectors on a grid"
    for name, axis in (("x", flow.x), ("y", flow.y)):
        if len(axis) < 5:
            return f"there are {len(axis)} cells along {name}, and it needs 5"
        step = np.diff(axis)
        if not np.abs(step / step.mean() - 1).max() < EVEN:
            return f"the cells are not evenly spaced along {name}"
    load = 0.0, 0.0
    if free and (line := flow.surface) is not None:
        height = line_heights(flow.t, flow.x, line)
        steep = folded(flow.t, flow.x, line)
    else:
        plate = _plate(flow)
        if plate is None:
            return NO_TOP
        height = np.full((len(flow.t), len(flow.x)), plate[0])
        steep, load = np.zeros(height.shape, bool), plate[1:]
    grains = np.asarray((flow.c > 0.5).any(axis=1))
    return Upright(flow, height, _clear(height, steep, grains, flow.x, reach), load)


def _plate(flow: Flow) -> tuple[float, float, float] | None:
    """Height, pressure and shear stress of a plate on the grains; None if there is none.

    The sides of the flow must be periodic, and the stress on the plate known.
    """
    if flow.walls is None or not flow.periodic:
        return None
    top = float(flow.y[np.flatnonzero((flow.c > 0).any(axis=(0, 2)))[-1]])
    walls = segments_of(flow.walls)
    along = np.abs(walls.ends[:, 1] - walls.ends[:, 0])
    known = np.isfinite(walls.p).all(axis=1) & np.isfinite(walls.tau).all(axis=1)
    known &= (along[:, 1] <= LEVEL * along[:, 0]) & (walls.ends[:, :, 1].min(axis=1) > top)
    if not known.any():
        return None
    height, p, tau = (
        float(np.average(a[known].mean(axis=1), weights=along[known, 0]))
        for a in (walls.ends[:, :, 1], walls.p, walls.tau)
    )
    return height, p, tau


def _clear(height: Float64, steep: Bool, grains: Bool, x: Float64, reach: int) -> Bool:
    slope = np.abs(np.diff(height, axis=1)) / (x[1] - x[0]) > STEEP
    bad = steep | (grains & ~np.isfinite(height))
    bad[:, 1:] |= slope
    bad[:, :-1] |= slope
    wide = np.pad(bad, ((0, 0), (reach, reach)))
    near = np.lib.stride_tricks.sliding_window_view(wide, 2 * reach + 1, axis=1)
    return np.asarray(~near.any(axis=2) & np.isfinite(height))
