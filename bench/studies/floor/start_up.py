r"""The start-up of Bagnold flow: an even layer on a slope, released from rest. No source term.

$$ \partial_t u = g \sin\theta + \partial_y (\mu(I)\, p), \quad p = g \cos\theta\, (1 - y), \quad
   I = d\, \partial_y u / \sqrt p, $$

with u = 0 on the slope. Grains that do not shear have the stress mu_s p: they accelerate together,
and the shear grows from the slope. After long times I is the same everywhere (Bagnold's profile).
Finite volumes with an error below 1e-6 give the profiles.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from bench.studies.floor.fields import GRAIN, THETA
from bench.studies.floor.sampling import centers
from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.flow import PERIOD_X, SURFACE_SD, Surface, Truth

SLOPE = math.atan(0.56)
END, CELLS, COLUMNS = 30.0, 1000, 8


def sample(cells: int, frames: int) -> Flow:
    """The exact velocity at the centers of `cells` rows, in `frames` frames after the first."""
    spacing = 1 / cells
    x, y = centers(COLUMNS, spacing), centers(cells + 2, spacing)
    t = np.linspace(0, END, frames + 1)
    c = np.broadcast_to((y < 1)[None, :, None], (t.size, y.size, x.size)).astype(np.float32)
    profile = velocity(frames)(y)
    u = np.where(c == 1, profile[:, :, None], np.nan).astype(np.float32)
    times, places = (a.ravel() for a in np.meshgrid(t, x, indexing="ij"))
    return Flow(
        t=t,
        y=y,
        x=x,
        u=u,
        v=np.where(c == 1, np.float32(0), np.float32(np.nan)),
        c=c,
        gravity=(math.sin(SLOPE), -math.cos(SLOPE)),
        density=1.0,
        grain_diameter=GRAIN,
        surface=Surface(times, places, np.ones_like(times), np.zeros_like(times, np.float32)),
        truth=Truth(*THETA),
        attributes={PERIOD_X: COLUMNS * spacing, SURFACE_SD: 0.0},
    )


@cache
def velocity(frames: int) -> CubicSpline:
    """u [frames + 1, n] as a function of y [n]."""
    edges = np.linspace(0, 1, CELLS + 1)
    centers, dy = (edges[1:] + edges[:-1]) / 2, 1 / CELLS
    p = math.cos(SLOPE) * (1 - edges)
    mu_s, mu_2, I_0 = THETA

    def acceleration(_: float, u: Float64) -> Float64:
        rate = np.zeros(CELLS + 1)
        rate[1:-1] = np.diff(u) / dy
        rate[0] = (9 * u[0] - u[1]) / (3 * dy)  # of the parabola through u = 0 on the slope
        I = GRAIN * np.maximum(rate, 0) / np.sqrt(np.maximum(p, 1e-300))
        tau = (mu_s + (mu_2 - mu_s) * I / (I_0 + I)) * p
        return math.sin(SLOPE) + np.diff(tau) / dy

    found = solve_ivp(
        acceleration,
        (0, END),
        np.zeros(CELLS),
        method="LSODA",
        t_eval=np.linspace(0, END, frames + 1),
        rtol=1e-8,
        atol=1e-9,
        lband=1,
        uband=1,
    )
    assert found.success, found.message
    with_slope = np.concatenate([np.zeros((1, frames + 1)), found.y])
    return CubicSpline(np.concatenate([[0.0], centers]), with_slope.T, axis=1)
