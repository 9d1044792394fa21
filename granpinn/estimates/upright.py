"""A flow on a regular grid below a surface line, for sums along the lines of y."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.data import Flow
from granpinn.data.surface import STEEP, folded, line_heights

NO_TOP = "the flow has no surface line, from which the stress is counted"
EVEN = 0.02  # largest relative difference of the spacings of a regular axis


class Upright(NamedTuple):
    """Vectors on a regular grid below a surface line, in units of the file.

    Attributes:
        flow: on an even grid.
        height: of the surface line in every column, [T, X]; NaN where there is no line.
        clear: columns in whose neighbourhood the line exists, is not steep and does not fold,
            [T, X].
    """

    flow: Flow
    height: Float64
    clear: Bool


def upright(flow: Flow, reach: int) -> Upright | str:
    """The flow with the height of its surface, or why the momentum balance cannot use it.

    Args:
        reach: columns on each side that the balance of a column uses.
    """
    line = flow.surface
    if line is None or line.t.size == 0:
        return NO_TOP
    if flow.particles is not None:
        return "the vectors are scattered, and it needs vectors on a grid"
    for name, axis in (("x", flow.x), ("y", flow.y)):
        if len(axis) < 5:
            return f"there are {len(axis)} cells along {name}, and it needs 5"
        step = np.diff(axis)
        if not np.abs(step / step.mean() - 1).max() < EVEN:
            return f"the cells are not evenly spaced along {name}"
    height = line_heights(flow.t, flow.x, line)
    steep = folded(flow.t, flow.x, line)
    grains = np.asarray((flow.c > 0.5).any(axis=1))
    return Upright(flow, height, _clear(height, steep, grains, flow.x, reach))


def _clear(height: Float64, steep: Bool, grains: Bool, x: Float64, reach: int) -> Bool:
    slope = np.abs(np.diff(height, axis=1)) / (x[1] - x[0]) > STEEP
    bad = steep | (grains & ~np.isfinite(height))
    bad[:, 1:] |= slope
    bad[:, :-1] |= slope
    wide = np.pad(bad, ((0, 0), (reach, reach)))
    near = np.lib.stride_tricks.sliding_window_view(wide, 2 * reach + 1, axis=1)
    return np.asarray(~near.any(axis=2) & np.isfinite(height))
