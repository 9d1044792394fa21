"""The start of a layer on a slope in one dimension, by an independent solver: the oracle.

With a velocity u(y, t) along the slope alone, which grows with y, the equations are

    du/dt = g sin + d(tau)/dy,   tau = min(mu(I) p, eta_max gamma_dot),   p = g cos (H - y)

for density 1, with u = 0 at the base and tau = 0 at the surface. Without a largest viscosity grains
that do not shear have the stress mu_s p: they accelerate together, and the shear grows from the
base. Rows of cells, and the variable steps and orders of LSODA in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from granpinn.arrays import Float64


@dataclass(frozen=True)
class Layer:
    """A layer of depth 1 and density 1 under g = 1 that obeys mu(I)."""

    mu_s: float
    mu_2: float
    I0: float
    d: float
    tangent: float  # of the slope
    eta_max: float = np.inf

    @property
    def cosine(self) -> float:
        return float(1 / np.sqrt(1 + self.tangent**2))

    def pressure(self, y: Float64) -> Float64:
        return self.cosine * (1 - y)

    def steady(self, y: Float64) -> Float64:
        """Bagnold's profile; I is the same everywhere."""
        inertial = self.I0 * (self.tangent - self.mu_s) / (self.mu_2 - self.tangent)
        rest = np.maximum(1 - y, 0) ** 1.5
        profile: Float64 = 2 / 3 * inertial / self.d * np.sqrt(self.cosine) * (1 - rest)
        return profile

    def stress(self, gamma_dot: Float64, p: Float64) -> Float64:
        inertial = self.d * gamma_dot / np.sqrt(p)
        mu: Float64 = self.mu_s + (self.mu_2 - self.mu_s) * inertial / (self.I0 + inertial)
        return mu * p if np.isinf(self.eta_max) else np.minimum(mu * p, self.eta_max * gamma_dot)


def velocity(layer: Layer, times: Sequence[float] | Float64, rows: int) -> tuple[Float64, Float64]:
    """y [rows] and u [times, rows] at the centers of the rows, from rest at t = 0."""
    h = 1 / rows
    y, faces = h * (np.arange(rows) + 0.5), h * np.arange(rows)
    p = layer.pressure(faces)

    def rate(t: float, u: Float64) -> Float64:
        slope = np.diff(u, prepend=0.0) / h
        slope[0] = (9 * u[0] - u[1]) / (3 * h)  # of the parabola through u = 0 at the base
        tau = layer.stress(np.maximum(slope, 0), p)
        forces: Float64 = layer.tangent * layer.cosine + np.diff(tau, append=0.0) / h
        return forces

    found = solve_ivp(
        rate,
        (0, times[-1]),
        np.zeros(rows),
        method="LSODA",
        t_eval=times,
        lband=1,
        uband=1,
        rtol=1e-8,
        atol=1e-9,
    )
    assert found.success, found.message
    return y, found.y.T
