"""The baseline: friction from the momentum balance alone, without a network and without pressure.

Gravity and the measured acceleration fix the stress below a free surface. With the deviator along
the strain rate, tau = q n, n = D/|D| (n_xx^2 + n_xy^2 = 1), and no stress on the surface y = h,

    N = p + q n_xx = int_y^h [rho (a_y - g_y) - d_x (q n_xy)] dy
    q n_xy         = int_y^h [-rho (a_x - g_x) - d_x (p - q n_xx)] dy

go down every vertical line of cells. d_x is taken of the integrals, which vanish at the surface.
The two are iterated from q = 0.4 p. Where |n_xy| is small q is not known and 0.4 p stays. A flow
that is periodic along x is averaged along x first: then d_x = 0 and nothing is iterated.

Applies to layers and heaps that rest on their base: not where side walls carry the grains (silo).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from bench.studies.grains.law import SLOWEST, binned_law
from bench.studies.grains.smooth import smooth
from granpinn.arrays import Bool, Float64
from granpinn.data import Flow

WINDOW = (2, 2, 2)  # cells on each side in the local fits of the velocity
START = 0.4  # q/p before the first iteration
LEAST_SHEAR = 0.7  # |n_xy| from which q is known
SHALLOWEST = 2.0  # d below the surface
DEEPEST = 20.0  # where d_x counts: its noise adds up on the way down
ITERATIONS = 20
SIDEWAYS = 7  # cells of the window in which d_x is taken


@dataclass(frozen=True)
class Balance:
    """Stress from the momentum balance, [T, Y, X]; X = 1 for a periodic flow.

    Attributes:
        p, q: pressure and norm of the deviator.
        inertial_number: I = gdot d sqrt(rho/p).
        used: full cells in which q is known.
    """

    p: Float64
    q: Float64
    inertial_number: Float64
    used: Bool


def momentum_balance(flow: Flow) -> Balance:
    """The stress of a flow with a surface line."""
    height = _height(flow)
    u, v, c = (np.asarray(a, np.float64) for a in (flow.u, flow.v, flow.c))
    spacing = tuple(float(np.diff(a).mean()) for a in (flow.t, flow.y, flow.x))
    half = (0 if flow.stated("steady") else WINDOW[0], WINDOW[1], WINDOW[2])
    if flow.stated("period_x"):
        u, v, c = (_mean_along_x(a, u) for a in (u, v, c))
        height = np.nanmean(height, axis=1, keepdims=True)
        half = (half[0], half[1], 0)
    weight = np.isfinite(u).astype(float)
    fit_u, fit_v = smooth([u, v], weight, (spacing[0], spacing[1], spacing[2]), half)
    d_xx, d_xy = (fit_u.x - fit_v.y) / 2, (fit_u.y + fit_v.x) / 2
    shear = np.hypot(d_xx, d_xy)
    a_x = fit_u.t + fit_u.value * fit_u.x + fit_v.value * fit_u.y
    a_y = fit_v.t + fit_u.value * fit_v.x + fit_v.value * fit_v.y
    known = np.isfinite(a_x) & (shear > 0)
    n_xx, n_xy = (np.divide(d, shear, out=np.zeros_like(d), where=known) for d in (d_xx, d_xy))
    below = height[:, None] - flow.y[:, None]
    p, q = _stress(
        flow.density * (_from_below(a_x) - flow.gravity[0]),
        flow.density * (_from_below(a_y) - flow.gravity[1]),
        (n_xx, n_xy, spacing[1], spacing[2]),
        below,
    )
    used = known & (np.abs(n_xy) > LEAST_SHEAR) & (p > 0) & (below > SHALLOWEST)
    used &= (below < DEEPEST) | (flow.stated("period_x") is not None)
    used &= c > (0.95 if flow.stated("period_x") else 0.999)
    used &= (q > 0) & (q < p)
    safe = np.where(p > 0, p, 1.0)
    number = 2 * shear * flow.grain_diameter * np.sqrt(flow.density / safe)
    return Balance(p, q, np.where(p > 0, number, 0.0), used)


def baseline(flow: Flow) -> dict[str, Any]:
    """Points and law of the momentum balance: mu = <q>/<p> in bins of I."""
    found = momentum_balance(flow)
    k = found.used & (found.inertial_number > SLOWEST)
    return binned_law(found.inertial_number[k], found.q[k], found.p[k])


def _stress(
    f_x: Float64, f_y: Float64, geometry: tuple[Float64, Float64, float, float], below: Float64
) -> tuple[Float64, Float64]:
    """p and q from the force densities rho (a - g), n and the depth of every cell."""
    n_xx, n_xy, dy, dx = geometry
    alone = below.shape[2] == 1
    weight = _integral(f_y, below, dy)
    drag = -_integral(f_x, below, dy)
    p, q = weight, START * weight
    known = np.abs(n_xy) > LEAST_SHEAR
    for _ in range(ITERATIONS):
        side = 0.0 if alone else _along_x(_integral(q * n_xy, below, dy), dx)
        p_new = weight - side - q * n_xx
        push = 0.0 if alone else _along_x(_integral(p - q * n_xx, below, dy), dx)
        q_new = np.divide(drag - push, n_xy, out=START * p_new, where=known)
        p = 0.5 * (p + p_new)
        q = 0.5 * (q + np.clip(q_new, 0, np.maximum(p, 0)))
    return p, q


def _along_x(integral: Float64, dx: float) -> Float64:
    window = min(SIDEWAYS, integral.shape[2] // 2 * 2 - 1)
    return np.asarray(savgol_filter(integral, window, 2, deriv=1, delta=dx, axis=2))


def _integral(density: Float64, below: Float64, dy: float) -> Float64:
    """From the middle of each cell up to the surface, [T, Y, X]; 0 above it."""
    thickness = np.clip(below + dy / 2, 0, dy)
    slabs = density * thickness
    above = np.cumsum(slabs[:, ::-1], axis=1)[:, ::-1] - slabs
    return np.asarray(np.where(below > 0, above + density * np.maximum(thickness - dy / 2, 0), 0.0))


def _from_below(values: Float64) -> Float64:
    """Gaps of a column filled with the nearest value below, then above, then 0."""
    filled = values.copy()
    for j in range(1, filled.shape[1]):
        filled[:, j] = np.where(np.isfinite(filled[:, j]), filled[:, j], filled[:, j - 1])
    for j in range(filled.shape[1] - 2, -1, -1):
        filled[:, j] = np.where(np.isfinite(filled[:, j]), filled[:, j], filled[:, j + 1])
    return np.nan_to_num(filled)


def _height(flow: Flow) -> Float64:
    """The surface line at the cells, [T, X]; NaN beyond its ends."""
    if flow.surface is None:
        raise ValueError("the momentum balance needs a surface line, got a flow without one")
    line = np.full((len(flow.t), len(flow.x)), np.nan)
    for k, t in enumerate(flow.t):
        at = np.isclose(flow.surface.t, t)
        x, y = flow.surface.x[at], flow.surface.y[at]
        order = np.argsort(x)
        if len(x):
            line[k] = np.interp(flow.x, x[order], y[order], left=np.nan, right=np.nan)
    return np.nan_to_num(line, nan=-np.inf) if not flow.stated("period_x") else line


def _mean_along_x(values: Float64, there: Float64) -> Float64:
    weight = np.isfinite(there)
    total = np.where(weight, values, 0.0).sum(axis=2, keepdims=True)
    count = weight.sum(axis=2, keepdims=True)
    enough = count > weight.shape[2] // 2
    return np.asarray(np.where(enough, total / np.maximum(count, 1), np.nan))
