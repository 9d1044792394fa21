"""Stress from the momentum balance alone, without a network and without measured pressures inside.

Gravity and the measured acceleration fix the stress below a free surface. With the deviator along
the strain rate, tau = q n, n = D/|D| (n_xx^2 + n_xy^2 = 1), and no stress on the surface y = h,

    N = p + q n_xx = int_y^h [rho (a_y - g_y) - d_x (q n_xy)] dy
    q n_xy         = int_y^h [-rho (a_x - g_x) - d_x (p - q n_xx)] dy

go down every line of cells along y. d_x is taken of the integrals, which vanish at the surface. In
the terms with q itself, q = mu(I) p with the law mu(I) = mu_s + (mu_2 - mu_s) I/(I + I0) that fits
the second line best. Both are iterated from q = 0.4 p. So the noise of q in a cell does not reach
the cells below it, nor those where the shear is not parallel to the axes, |n_xy| << 1. A flow that
is periodic along x is averaged along x first: then d_x = 0. Friction of side walls adds the force
-k p v/|v| to rho g (granpinn/physics/constants.py), also iterated.

Velocities are smoothed by local quadratic fits. The error of the shear rate is estimated from what
the fits leave, and its square is subtracted from that of the shear rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Bool, Float64, Index
from granpinn.data import Flow
from granpinn.data.flow import WALL_GAP
from granpinn.data.surface import STEEP, folded, line_heights
from granpinn.estimates.local_fits import line_slopes, local_fits
from granpinn.physics.constants import AT_REST, side_wall

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


START = 0.4  # q/p before the first iteration
LEAST_SHEAR = 0.7  # |n_xy| from which q is known
SHALLOWEST = (2.0, 1.0)  # grain diameters and cells below the surface
LEAST_WEIGHT = 0.3  # p over the weight of the grains above: less is nearly free fall
RATE_OVER_NOISE = 2.5  # least shear rate in standard deviations
SLOWEST = 3e-3  # least inertial number of a cell that is used
LARGEST = 1.5  # friction of the law that is iterated
ITERATIONS = 20
SIDEWAYS = 7  # cells of the window in which d_x is taken
FULL = 0.999  # volume fraction of a cell that is used; of a row, if it is averaged along x:
FULL_ROW = 0.95
MOST_CELLS = 25_000  # frames are left out from this number of vectors on
FEWEST_FRAMES = 5  # of a flow that changes with time
FEWEST_CELLS = 20  # that the law is fitted to
LEAST_LEFT = 0.1  # of the variance of the noise, by local fits that show it


@dataclass(frozen=True, eq=False)
class Stress:
    """Stress of the chosen frames, [K, Y, X]; X = 1 for a periodic flow; units of the file.

    Attributes:
        frames: their indices [K].
        p: pressure.
        shear, normal: q n_xy and p n_xy with the sign of n_xy; their ratio is the friction.
        inertial_number: I = gdot d sqrt(rho_grain/p).
        depth: below the surface line.
        used: full cells that shear and in which q is known.
        sigma: noise of a velocity component, from what the local fits leave.
        rate_error: standard deviation of the shear rate over its median.
    """

    frames: Index
    p: Float64
    shear: Float64
    normal: Float64
    inertial_number: Float64
    depth: Float64
    used: Bool
    sigma: float
    rate_error: float


def momentum_balance(
    flow: Flow, half: int = 2, I0: float = 0.3, wall_friction: float = 0.0
) -> Stress | str:
    """The stress of a flow, or the reason in words why the balance does not apply.

    Args:
        half: cells on each side of the windows of the local fits; frames: at least 2.
        I0: inertial scale of the law that is iterated.
        wall_friction: friction of the side walls, where the flow states their distance.
    """
    pose = upright(flow, SIDEWAYS // 2)
    if isinstance(pose, str):
        return pose
    flow = pose.flow
    chosen = _frames(pose, max(half, 2))
    if isinstance(chosen, str):
        return chosen
    found = [_kinematics(pose, int(k), half) for k in chosen]
    a_x, a_y, d_xx, d_xy, c, below, rest, left, of_rate, *v = (
        np.stack(part) for part in zip(*found, strict=True)
    )
    _, dy, dx = _spacing(flow, slice(None))
    rate = 2 * np.hypot(d_xx, d_xy)
    known = np.isfinite(a_x) & (rate > 0)
    nan = np.full_like(rate, np.nan)
    n_xx, n_xy = (filled(np.divide(2 * d, rate, out=nan.copy(), where=known)) for d in (d_xx, d_xy))
    gdot = filled(rate)
    full = known & (c > (FULL_ROW if flow.periodic else FULL))
    full &= below > max(SHALLOWEST[0] * flow.grain_diameter, SHALLOWEST[1] * dy)
    if not flow.periodic:
        full &= pose.clear[chosen][:, None]
    if not full.any():
        return "no full cell lies below a surface line that is not steep and does not fold"
    noise = float(left[full].mean())
    sigma = float(np.sqrt(rest[full].mean() / noise)) if noise > LEAST_LEFT else np.nan
    error = sigma * float(np.median(of_rate[full]))
    usual = float(np.median(gdot[full]))
    full &= (np.abs(n_xy) > LEAST_SHEAR) & (gdot > RATE_OVER_NOISE * error)
    gdot = np.sqrt(np.maximum(gdot**2 - error**2, 0.0))
    density = flow.density if flow.grain_density is None else flow.grain_density
    lines = _Lines(
        drag=-_integral(flow.density * (filled(a_x) - flow.gravity[0]), below, dy),
        weight=_integral(flow.density * (filled(a_y) - flow.gravity[1]), below, dy),
        hydrostatic=-flow.gravity[1] * flow.density * np.where(below > 0, below, np.inf),
        n_xx=n_xx,
        n_xy=n_xy,
        rate=gdot * flow.grain_diameter * np.sqrt(density),
        below=below,
        full=full,
        spacing=(dy, dx),
        side_walls=side_walls(flow, wall_friction, *map(filled, v)),
    )
    p, shear, used = lines.solve(I0)
    side = np.sign(n_xy)
    number = lines.inertial_number(p)
    return Stress(
        chosen, p, side * shear, p * np.abs(n_xy), number, below, used, sigma, error / usual
    )


@dataclass(frozen=True, eq=False)
class _Lines:
    """What the balance integrates down the lines of cells; all [K, Y, X].

    Attributes:
        drag, weight: integrals of -rho (a_x - g_x) and rho (a_y - g_y) from the surface down.
        hydrostatic: the weight of grains at rest, infinite above the surface.
        n_xx, n_xy: direction of the strain rate.
        rate: I sqrt(p).
        below: depth below the surface.
        full: cells whose stress is known.
        spacing: of the cells along y and x.
        side_walls: k v/|v| of their friction, along x and y; None without them.
    """

    drag: Float64
    weight: Float64
    hydrostatic: Float64
    n_xx: Float64
    n_xy: Float64
    rate: Float64
    below: Float64
    full: Bool
    spacing: tuple[float, float]
    side_walls: tuple[Float64, Float64] | None

    def solve(self, I0: float) -> tuple[Float64, Float64, Bool]:
        """p, q n_xy, and the cells in which they are used."""
        p, q = self.weight, START * self.weight
        law = np.array([START, START])
        for _ in range(ITERATIONS):
            drag, weight = self._forces(p)
            p = (p + weight - self._along_x(q * self.n_xy) - q * self.n_xx) / 2
            shear = drag - self._along_x(p - q * self.n_xx)
            number = self.inertial_number(p)
            used = self.full & (p > LEAST_WEIGHT * self.hydrostatic) & (number > SLOWEST)
            x = number / (number + I0)
            if used.sum() >= FEWEST_CELLS:
                law = (law + _law(x[used], shear[used] / p[used], self.n_xy[used])) / 2
            mu = np.clip(law[0] * (1 - x) + law[1] * x, 0.0, LARGEST)
            q = (q + mu * np.maximum(p, 0.0)) / 2
        return p, shear, used

    def _forces(self, p: Float64) -> tuple[Float64, Float64]:
        """`drag` and `weight` with the friction of side walls under a pressure."""
        if self.side_walls is None:
            return self.drag, self.weight
        f_x, f_y = (
            -_integral(along * np.maximum(p, 0.0), self.below, self.spacing[0])
            for along in self.side_walls
        )
        return self.drag + f_x, self.weight - f_y

    def inertial_number(self, p: Float64) -> Float64:
        """I with a pressure; 0 where that is not positive."""
        return np.asarray(self.rate / np.sqrt(np.where(p > 0, p, np.inf)))

    def _along_x(self, stress: Float64) -> Float64 | float:
        """d_x of the integral of a stress from the surface down; 0 for a single line."""
        dy, dx = self.spacing
        integral = _integral(stress, self.below, dy)
        if integral.shape[2] == 1:
            return 0.0
        return line_slopes(integral, SIDEWAYS, dx)


def _law(x: Float64, ratio: Float64, n_xy: Float64) -> Float64:
    """(mu_s, mu_2) from q n_xy / p = n_xy (mu_s (1 - x) + mu_2 x), x = I/(I + I0), by least
    squares."""
    matrix = np.stack([n_xy * (1 - x), n_xy * x], axis=1)
    return np.asarray(np.linalg.lstsq(matrix, ratio, rcond=None)[0])


def _frames(pose: Upright, half: int) -> Index | str:
    """Frames with a surface line and evenly spaced neighbors, at most MOST_CELLS vectors."""
    flow = pose.flow
    n = len(flow.t)
    if not flow.steady and n < FEWEST_FRAMES:
        return f"the flow has {n} frames, and the acceleration needs {FEWEST_FRAMES}"
    good: Bool = np.asarray(np.isfinite(pose.height).any(axis=1))
    if not flow.steady:
        step = np.diff(flow.t)
        usual = np.mean(step)
        for k in range(n):
            near = step[max(0, k - half) : min(n - 1, k + half)]
            good[k] &= bool(np.abs(near / usual - 1).max() < 0.02)
    found = np.flatnonzero(good)
    if len(found) == 0:
        return "no frame has a surface line and neighbors at even intervals of time"
    vectors = sum(int(np.isfinite(flow.u[k]).sum()) for k in found)
    every = 1 if flow.periodic else max(1, -(-vectors // MOST_CELLS))
    return np.asarray(found[min(every - 1, len(found) - 1) // 2 :: every])


def _kinematics(pose: Upright, k: int, half: int) -> tuple[Float64, ...]:
    """a_x, a_y, d_xx, d_xy, c, depth, squared rest of the fit and the share of the noise in it,
    error of the shear rate for errors of 1, u, v of one frame [Y, X]."""
    flow = pose.flow
    frames = _windows(flow, half)[0]
    before = min(frames, k)
    near = slice(k - before, k + frames + 1)
    u, v, c = (np.asarray(a[near], np.float64) for a in (flow.u, flow.v, flow.c))
    height = pose.height[k]
    if flow.periodic:
        u, v, c = (mean_along_x(a, u) for a in (u, v, c))
        height = np.nanmean(height, keepdims=True)
    there = np.isfinite(u) & np.isfinite(v)
    u, v = (np.where(there, a, 0.0) for a in (u, v))
    cells, windows = there.astype(float), _windows(flow, half)
    fit = local_fits([u, v], cells, _spacing(flow, near), windows, 2, frame=before)
    (U, V), ((u_t, v_t), (u_y, v_y), (u_x, v_x)) = fit.value.T, fit.slopes.transpose(1, 2, 0)
    rest = ((u[fit.index] - U) ** 2 + (v[fit.index] - V) ** 2) / 2
    acceleration = (u_t + U * u_x + V * u_y, v_t + U * v_x + V * v_y)
    strain = ((u_x - v_y) / 2, (u_y + v_x) / 2)
    below = np.nan_to_num(height, nan=-np.inf)[None, :] - flow.y[:, None]
    of_fit = (rest, 1 - fit.value_sd**2, np.hypot(fit.sd[:, 1], fit.sd[:, 2]), U, V)
    return (
        *(fit.on_grid(a, u.shape)[before] for a in (*acceleration, *strain)),
        c[before],
        below,
        *(fit.on_grid(a, u.shape)[before] for a in of_fit),
    )


def _windows(flow: Flow, half: int) -> tuple[int, int, int]:
    """Frames and cells on each side in the local fits; a slope in time needs 2 at the ends."""
    return (0 if flow.steady else max(half, 2), half, 0 if flow.periodic else half)


def _spacing(flow: Flow, near: slice) -> tuple[float, float, float]:
    """Of the frames `near`, and of the cells along y and x."""
    t = flow.t[near]
    step = float(np.diff(t).mean()) if len(t) > 1 else 1.0
    return step, float(np.diff(flow.y).mean()), float(np.diff(flow.x).mean())


def _integral(density: Float64, below: Float64, dy: float) -> Float64:
    """From the middle of each cell up to the surface, [K, Y, X]; 0 above it."""
    thickness = np.clip(below + dy / 2, 0, dy)
    slabs = density * thickness
    above = np.cumsum(slabs[:, ::-1], axis=1)[:, ::-1] - slabs
    return np.asarray(np.where(below > 0, above + density * np.maximum(thickness - dy / 2, 0), 0.0))


def side_walls(
    flow: Flow, friction: float, u: Float64, v: Float64
) -> tuple[Float64, Float64] | None:
    """k v/|v| along x and y [K, Y, X]; times -p it is the force (granpinn/physics/constants.py).

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
    k = side_wall(friction, gap)
    return k * u / speed, k * v / speed


def filled(values: Float64) -> Float64:
    """Gaps filled with the nearest value below, above, to the left, to the right; else 0."""
    found = values
    for axis, order in ((1, 1), (1, -1), (2, 1), (2, -1)):
        n = found.shape[axis]
        place = np.arange(n).reshape([n if a == axis else 1 for a in range(3)])
        lines = np.flip(found, axis) if order < 0 else found
        last = np.maximum.accumulate(np.where(np.isfinite(lines), place, 0), axis=axis)
        lines = np.take_along_axis(lines, last, axis)
        found = np.flip(lines, axis) if order < 0 else lines
    return np.nan_to_num(found)


def mean_along_x(values: Float64, there: Float64) -> Float64:
    """Means over the places where `there` is finite [..., 1]; NaN in rows that are mostly gaps."""
    weight = np.isfinite(there)
    total = np.where(weight, values, 0.0).sum(axis=2, keepdims=True)
    count = weight.sum(axis=2, keepdims=True)
    enough = count > weight.shape[2] // 2
    return np.asarray(np.where(enough, total / np.maximum(count, 1), np.nan))
