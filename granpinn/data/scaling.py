"""The scales and the origin of a flow, and the constants of its material for the equations.

The network has coordinates of float32. Unix time or the coordinates of a map would all be rounded
to a few values there, so such coordinates are counted from their first value, still in float64.
"""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.data.flow import WALL_GAP, Flow, FlowFileError
from granpinn.data.symmetry import axes_of
from granpinn.physics.axes import Axes
from granpinn.physics.constants import side_wall
from granpinn.physics.scales import Scales

FLOAT32 = 2.0**-23  # distance of neighboring float32 numbers, relative
SMALL_PART = 2.0**-10  # of a step, by which float32 may round a coordinate
# Positions and velocities are rounded to this, the resolution of float32 at 1 and far below any
# measurement. The same data in other units differ by 1e-16. After rounding they are equal, and so
# are their trainings.
RESOLUTION = 2.0**-24


def scales_of(flow: Flow) -> Scales:
    """The scales of a flow of grains under gravity, from its height in the first frame.

    The origin is that of the file for each coordinate that float32 resolves there.

    Raises:
        FlowFileError: the flow has no grains in its first frame.
    """
    origin = (origin_of(flow.x), origin_of(flow.y), origin_of(flow.t))
    return Scales.of(initial_height(flow), flow.gravity, flow.density, origin)


def origin_of(values: Float64) -> float:
    """The origin of a coordinate for the training, in its unit: 0, or its first value.

    It is the first value if 0 is farther away than the whole extent of the coordinate, and if
    float32 rounds the farthest value by more than a small part of the smallest step.

    Args:
        values: the coordinate [n], increasing.
    """
    low, high = float(values[0]), float(values[-1])
    if values.size == 1:  # the time of a steady flow
        return low
    extent = high - low
    if low - extent <= 0 <= high + extent:
        return 0.0
    rounding = FLOAT32 * max(abs(low), abs(high))
    return low if rounding > SMALL_PART * float(np.diff(values).min()) else 0.0


def placed(x: Float64, y: Float64, t: Float64, flow: Flow, scales: Scales) -> Float64:
    """Points in the units of the file [n] as (x, y, t) of the training [n, 3]."""
    return turned_and_rounded(scales.points_to_dimensionless(x, y, t), axes_of(flow))


def unplaced(points: Float64, flow: Flow, scales: Scales) -> Float64:
    """The inverse of `placed`: points (x, y, t) [n, 3] in the units of the file."""
    x, y, t = points.T
    return scales.points_to_physical(np.stack([*axes_of(flow).undo(x, y), t], -1))


def moving(u: Floats, v: Floats, flow: Flow, scales: Scales) -> Float64:
    """Velocities in the units of the file [n] as (u, v) of the training [n, 2]."""
    velocity = scales.to_dimensionless(np.stack([u, v], -1, dtype=np.float64), "velocity")
    return turned_and_rounded(velocity, axes_of(flow))


def turned_and_rounded(values: Float64, axes: Axes) -> Float64:
    """Vectors [n, 2] or points [n, 3] in the axes of the training, multiples of `RESOLUTION`."""
    turned = np.stack([*axes.turn(*values.T[:2]), *values.T[2:]], -1)
    return np.asarray(np.rint(turned / RESOLUTION) * RESOLUTION)


def inertial_diameter(flow: Flow, scales: Scales) -> float:
    r"""The grain diameter of the inertial number, $d \sqrt{\rho_g / \rho} / H_0$, dimensionless.

    The equations have one density, the bulk density $\rho = 1$, but the inertial number
    $I = d \dot\gamma / \sqrt{p / \rho_g}$ has that of a grain. The paper sets both equal, as does
    a file without `grain_density`.
    """
    grain_density = flow.density if flow.grain_density is None else flow.grain_density
    effective = flow.grain_diameter * math.sqrt(grain_density / flow.density)
    return scales.to_dimensionless(effective, "length")


def side_wall_of(flow: Flow, scales: Scales, friction: float) -> float:
    """k = 2 mu_w / W of side walls with a friction mu_w, dimensionless; 0 without `wall_gap`."""
    gap = flow.stated(WALL_GAP)
    return 0.0 if gap is None else side_wall(friction, scales.to_dimensionless(gap, "length"))


def initial_height(flow: Flow) -> float:
    """Extent of the cells full of grains in the first frame, measured against gravity.

    From the lowest to the highest cell center with c = 1, and half a cell on either side; for
    scattered vectors from the lowest to the highest of the first time, and half a grain. In a flow
    with periodic sides it is the extent along y, the thickness of the layer.
    """
    p = flow.particles
    if p is not None:
        first = p.t == p.t.min()
        x, y, cell = p.x[first], p.y[first], flow.grain_diameter
    else:
        rows, columns = np.nonzero(flow.c[0] >= 1)
        if rows.size == 0:
            raise FlowFileError(
                "c must be 1 at some point of the first frame, whose height of grains sets the "
                f"length scale, got at most {flow.c[0].max():g}: set c to exactly 1 inside the "
                "material, and leave out the frames before the grains are seen"
            )
        x, y, cell = flow.x[columns], flow.y[rows], flow.spacing[1]
        if not flow.periodic:
            g, pairs = math.hypot(*flow.gravity), zip(flow.gravity, flow.spacing, strict=True)
            cell = sum(abs(g_i) / g * d_i for g_i, d_i in pairs)
    h = y if flow.periodic else flow.height(x, y)
    return float(h.max() - h.min()) + cell
