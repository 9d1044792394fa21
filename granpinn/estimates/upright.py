"""A flow, turned by quarters until gravity points mostly down, for sums along vertical lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.arrays import Bool, Float64, Floats
from granpinn.data import Flow
from granpinn.data.surface import STEEP, folded, line_heights
from granpinn.data.walls import segments_of

NO_TOP = (
    "the flow has no surface line nor, with periodic sides, a plate of known pressure and shear "
    "stress, and the stress is counted from these"
)
LEVEL = 0.02  # largest slope of a plate
EVEN = 0.02  # largest relative difference of the spacings of a regular axis


@dataclass(frozen=True, eq=False)
class Upright:
    """Vectors on a regular grid below a surface line, in units of the file.

    Attributes:
        t, y, x: axes [T], [Y], [X]; y up within 45 degrees.
        u, v, c: [T, Y, X], as in Flow.
        gravity: (g_x, g_y) in these axes, g_y < 0.
        height: of the surface line in every column, [T, X]; NaN where there is no line. Without a
            line, of a plate on the grains.
        clear: columns in whose neighbourhood the line exists, is not steep and does not fold,
            [T, X].
        interval: the usual one between frames, the mean; in a flow of runs (`Flow.starts`) the
            median, since gaps lie between them.
        steady: whether the flow does not change with time.
        periodic: whether it repeats along x.
        load: pressure and size of the shear stress at `height`; 0 on a free surface.
    """

    t: Float64
    y: Float64
    x: Float64
    u: Floats
    v: Floats
    c: Floats
    gravity: tuple[float, float]
    height: Float64
    clear: Bool
    interval: float
    steady: bool
    periodic: bool
    load: tuple[float, float] = (0.0, 0.0)


def upright(flow: Flow, reach: int) -> Upright | str:
    """The flow in upright axes, or the reason why the momentum balance cannot use it.

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
        if not _even(axis):
            return f"the cells are not evenly spaced along {name}"
    turned = _Turn(flow.gravity)
    x, y = turned.axes(flow.x, flow.y)
    u, v = turned.vector(flow.u, flow.v)
    c = turned.grid(flow.c)
    load = 0.0, 0.0
    if free and flow.surface is not None:
        line = turned.points(flow.surface.x, flow.surface.y)
        height = line_heights(flow.t, x, flow.surface.t, *line)
        steep = folded(flow.t, x, flow.surface.t, *line)
    else:
        plate = _plate(flow, turned, float(y[np.flatnonzero((c > 0).any(axis=(0, 2)))[-1]]))
        if plate is None:
            return NO_TOP
        level, load = plate[0], plate[1:]
        height = np.full((len(flow.t), len(x)), level)
        steep = np.zeros(height.shape, bool)
    return Upright(
        t=flow.t,
        y=y,
        x=x,
        u=turned.grid(u),
        v=turned.grid(v),
        c=c,
        gravity=turned.points(*flow.gravity),
        height=height,
        clear=_clear(height, steep, np.asarray((c > 0.5).any(axis=1)), x, reach),
        interval=_interval(flow),
        steady=flow.steady,
        periodic=_periodic(flow, turned),
        load=load,
    )


def _interval(flow: Flow) -> float:
    usual = np.median if flow.starts else np.mean
    return float(usual(np.diff(flow.t))) if flow.t.size > 1 else 0.0


def _periodic(flow: Flow, turned: _Turn) -> bool:
    return flow.periodic and turned.quarters == 0


def _plate(flow: Flow, turned: _Turn, top: float) -> tuple[float, float, float] | None:
    """Height, pressure and shear stress of a plate on the grains; None if there is none.

    The sides of the flow must be periodic, and the stress on the plate known.

    Args:
        top: height of the highest cell of grains in upright axes.
    """
    if flow.walls is None or not _periodic(flow, turned):
        return None
    walls = segments_of(flow.walls)
    ends = turned_walls(flow.gravity, walls.ends)
    along = np.abs(ends[:, 1] - ends[:, 0])
    known = np.isfinite(walls.p).all(axis=1) & np.isfinite(walls.tau).all(axis=1)
    known &= (along[:, 1] <= LEVEL * along[:, 0]) & (ends[:, :, 1].min(axis=1) > top)
    if not known.any():
        return None
    height, p, tau = (
        float(np.average(a[known].mean(axis=1), weights=along[known, 0]))
        for a in (ends[:, :, 1], walls.p, walls.tau)
    )
    return height, p, tau


class _Turn:
    """Quarter turns of the axes, counted so that gravity (0, -1) needs none."""

    def __init__(self, gravity: tuple[float, float]) -> None:
        g_x, g_y = gravity
        if abs(g_y) >= abs(g_x):
            self.quarters = 0 if g_y < 0 else 2
        else:
            self.quarters = 1 if g_x > 0 else 3

    def points(self, x: Any, y: Any) -> tuple[Any, Any]:
        """(x, y) in the turned axes."""
        return ((x, y), (y, -x), (-x, -y), (-y, x))[self.quarters]

    def vector(self, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Components in the turned axes, on the grid as it was."""
        return self.points(u, v)

    def axes(self, x: Float64, y: Float64) -> tuple[Float64, Float64]:
        """The turned axes x and y, ascending."""
        new_x, new_y = self.points(x, y)
        return np.sort(new_x), np.sort(new_y)

    def grid(self, values: Floats) -> Floats:
        """[T, Y, X] in the order of the turned axes."""
        return np.rot90(values, self.quarters, axes=(1, 2))


def turned_walls(gravity: tuple[float, float], places: Float64) -> Float64:
    """Places (x, y) on the last axis, in the axes of `upright`."""
    return np.stack(_Turn(gravity).points(places[..., 0], places[..., 1]), -1)


def _even(axis: Float64) -> bool:
    step = np.diff(axis)
    return bool(np.abs(step / step.mean() - 1).max() < EVEN)


def _clear(height: Float64, steep: Bool, grains: Bool, x: Float64, reach: int) -> Bool:
    slope = np.abs(np.diff(height, axis=1)) / (x[1] - x[0]) > STEEP
    bad = steep | (grains & ~np.isfinite(height))
    bad[:, 1:] |= slope
    bad[:, :-1] |= slope
    wide = np.pad(bad, ((0, 0), (reach, reach)))
    near = np.lib.stride_tricks.sliding_window_view(wide, 2 * reach + 1, axis=1)
    return np.asarray(~near.any(axis=2) & np.isfinite(height))
