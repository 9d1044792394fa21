r"""A flow on one dimensionless grid, and the derivatives of its velocities with known errors.

The view of a flow of either layout has the mean of the vectors in every cell. Derivatives are those
of local fits of order 1, in which the weight of a cell is its number of vectors (local_fits.py). An
axis of two cells has no slope and an infinite error. In a steady flow $u_t = 0$ without an error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float32, Float64, Index, nearest
from granpinn.data import Flow
from granpinn.data.scaling import inertial_diameter
from granpinn.estimates.local_fits import local_fits
from granpinn.physics.scales import Scales


@dataclass(frozen=True, eq=False)
class View:
    """A flow in units of H0 and sqrt(|g| H0).

    Attributes:
        t, y, x: time [T] and cell centers [Y], [X].
        u, v: velocity [T, Y, X], 0 in cells without vectors.
        count: vectors per cell [T, Y, X]: 0 or 1 on a grid, any number for particles.
        grains: cells full of grains [T, Y, X].
        gravity: unit vector.
        d: grain diameter of the inertial number (`data.scaling.inertial_diameter`).
        steady: whether all frames show one flow.
    """

    t: Float64
    y: Float64
    x: Float64
    u: Float64
    v: Float64
    count: Float64
    grains: Bool
    gravity: tuple[float, float]
    d: float
    steady: bool

    @property
    def there(self) -> Bool:
        """Cells that hold at least one vector."""
        there: Bool = self.count > 0
        return there

    @property
    def steps(self) -> tuple[float, float, float]:
        """Median spacing in t, y and x; that of t is infinite for one frame."""
        y, x = (float(np.median(np.diff(axis))) for axis in (self.y, self.x))
        return float(np.median(np.diff(self.t))) if self.t.size > 1 else math.inf, y, x


def view_of(flow: Flow, scales: Scales) -> View:
    """The flow as a View; a cell has the mean of the particles in it."""
    g = math.hypot(*flow.gravity)
    x_0, y_0, t_0 = scales.origin
    count = flow.valid.astype(np.float64) if flow.particles is None else _counts(flow)
    there = count > 0

    def velocity(values: Float32) -> Float64:
        scaled = scales.to_dimensionless(values.astype(np.float64), "velocity")
        return np.where(there, scaled, 0.0)

    return View(
        t=scales.points_to_dimensionless(x_0, y_0, flow.t)[:, 2],
        y=scales.points_to_dimensionless(x_0, flow.y, t_0)[:, 1],
        x=scales.points_to_dimensionless(flow.x, y_0, t_0)[:, 0],
        u=velocity(flow.u),
        v=velocity(flow.v),
        count=count,
        grains=flow.material,
        gravity=(flow.gravity[0] / g, flow.gravity[1] / g),
        d=inertial_diameter(flow, scales),
        steady=flow.steady,
    )


def _counts(flow: Flow) -> Float64:
    """Particles in each cell of the view [T, Y, X]."""
    assert flow.particles is not None
    place = [
        nearest(axis, values)
        for axis, values in (
            (flow.t, flow.particles.t),
            (flow.y, flow.particles.y),
            (flow.x, flow.particles.x),
        )
    ]
    index = np.ravel_multi_index(tuple(place), flow.c.shape)
    count = np.bincount(index, minlength=flow.c.size).reshape(flow.c.shape)
    return np.where(np.isfinite(flow.u), count, 0).astype(np.float64)


LARGEST_HALF_WIDTH = 4  # of a window in cells, the same in t, y and x
# The window grows until the error of the shear rate is below this part of its rms.
WANTED_ERROR = 0.1


@dataclass(frozen=True, eq=False)
class Gradients:
    """Derivatives at K cells, dimensionless.

    Attributes:
        index: (frame, row, column) of the cells, three arrays [K].
        vectors: vectors in each of them [K].
        u, v: smoothed velocity [K].
        du, dv: derivatives of u and v with respect to t, y and x, [K, 3].
        sd: standard deviations of these derivatives (the same for u and v), [K, 3].
        half_width: of the window, in cells.
    """

    index: tuple[Index, ...]
    vectors: Float64
    u: Float64
    v: Float64
    du: Float64
    dv: Float64
    sd: Float64
    half_width: int

    @property
    def bias(self) -> Float64:
        """Mean contribution of noise to the square of the shear rate [K]."""
        return np.asarray(2 * (self.sd[:, 1] ** 2 + self.sd[:, 2] ** 2))

    @property
    def gamma_dot(self) -> Float64:
        """Shear rate [K], less its bias."""
        (_, u_y, u_x), (_, v_y, v_x) = self.du.T, self.dv.T
        return shear_rate(u_x, u_y, v_x, v_y, self.bias)

    @property
    def divergence(self) -> Float64:
        """u_x + v_y [K]."""
        return np.asarray(self.du[:, 2] + self.dv[:, 1])

    @property
    def acceleration(self) -> Float64:
        """Dv/Dt [K, 2] in units of |g|, from the velocity and slopes of the window."""
        a = [d[:, 0] + self.u * d[:, 2] + self.v * d[:, 1] for d in (self.du, self.dv)]
        return np.stack(a, axis=-1)


def gradients(view: View, sigma: float) -> Gradients:
    """Derivatives in windows that grow with the noise, up to LARGEST_HALF_WIDTH.

    In d = 3 dimensions the error of a slope falls with the half-width m as m^(-1 - d/2).

    Args:
        sigma: standard deviation of one component of one vector, dimensionless.
    """
    found = _fit(view, sigma, 1)
    if found.u.size == 0:
        return found
    error = math.sqrt(float(np.median(found.bias)))
    size = math.sqrt(float(np.mean(found.gamma_dot**2)))
    if error <= WANTED_ERROR * size:
        return found
    wanted = LARGEST_HALF_WIDTH if size == 0 else (error / (WANTED_ERROR * size)) ** 0.4
    return _fit(view, sigma, min(math.ceil(wanted), LARGEST_HALF_WIDTH))


def _fit(view: View, sigma: float, m: int) -> Gradients:
    half = [min(m, (n - 1) // 2) for n in view.count.shape]
    half[0] *= not view.steady
    found = local_fits([view.u, view.v], view.count, view.steps, (half[0], half[1], half[2]), 1)
    sd = sigma * found.sd
    for axis in range(int(view.steady), 3):
        if half[axis] == 0:
            sd[:, axis] = np.inf
    return Gradients(
        index=found.index,
        vectors=view.count[found.index],
        u=found.value[:, 0],
        v=found.value[:, 1],
        du=found.slopes[..., 0],
        dv=found.slopes[..., 1],
        sd=sd,
        half_width=m,
    )


def shear_rate(u_x: Float64, u_y: Float64, v_x: Float64, v_y: Float64, bias: Float64) -> Float64:
    r"""$\dot\gamma$, with $\dot\gamma^2 = (u_x - v_y)^2 + (u_y + v_x)^2$ less its bias, at least 0.

    Args:
        bias: mean contribution of the noise to the square, of the shape of the slopes.
    """
    return np.asarray(np.sqrt(np.maximum((u_x - v_y) ** 2 + (u_y + v_x) ** 2 - bias, 0.0)))
