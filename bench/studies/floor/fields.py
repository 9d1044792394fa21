r"""Manufactured flows: closed forms of velocity, pressure and free surface, and their source term.

Grains lie on a floor at y = 0 under the free surface y = h(x, t). The velocity has a stream
function, u = psi_y and v = -psi_x: it is divergence-free, and psi(y = 0) = 0 lets no grains through
the floor. Grains of the surface stay there, $h_t + \partial_x \psi(x, h(x, t), t) = 0$.

- smooth: $\psi = Q F(y/h)$ with F(1) = 1, $h = h_0 + A\,\mathrm{sech}^2 \xi \cos \omega t$,
  $\xi = (x - x_0)/w$, and $Q = q(t) + A \omega w \tanh \xi \sin \omega t$, so that $Q_x = -h_t$.
  The shear $F'' \sim (1 - \eta) e^{b \eta}$ grows from the floor to below the surface.
- layer: the same, but a third of the flux slips over a layer at the floor with the thickness 0.03,
  $F' \sim 1 - e^{-\eta/0.03}$.
- plug: $u = q(t)(1 + \tanh((y - y_p)/\ell))$ up to constants, a shear band between grains that
  hardly shear: at 3e-5, where the smoothing of the kernels, at 1e-6, does not count. The surface
  $h = h_0 + A \cos k(x - X(t))$ rides on them, $X' = u$.

with $q = q_0 + (q_1 - q_0) \sin^2(\pi t / 2 t_1)$. The pressure is
$p = (h - y)(1 + a \sin(2 x + y - t))$, and the stress that of mu(I) with the
regularisation of the kernels. The source term is what the momentum equation then lacks: with it,
these fields are an exact solution of the equations of a training. All is in units of the height, of
gravity and of the density.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import sympy as sp
import torch

from granpinn.arrays import Float64
from granpinn.kernels import ops
from granpinn.physics.constants import Physics

X, Y, T = sp.symbols("x y t", real=True)
ETA = sp.Symbol("eta", real=True)

THETA = (0.40, 0.64, 0.3)  # mu_s, mu_2, I0
GRAIN = 0.04  # diameter of the grains
WIDTH, END = 2.0, 4.0  # of the window in x, and last time
HEIGHT, SWELL, SIZE, RATE = 0.85, 0.15, 0.6, 1.5  # h_0, A, w and omega of the surface
SLOW, FAST = 0.1, 1.2  # q_0 and q_1
STEEPNESS = 6  # b
LAYER, SLIP = sp.Rational(3, 100), sp.Rational(1, 3)
BAND, BAND_SIZE = sp.Rational(7, 20), sp.Rational(3, 50)  # y_p and ell
REST = 3e-5  # shear rate of grains outside of the band
WAVE = 0.15  # a
PHYSICS = Physics(
    grain_diameter=GRAIN,
    g_x=0.0,
    g_y=-1.0,
    eta_min=0.0,
    eta_max=np.inf,
    velocity_scale=1.0,
    pressure_scale=1.0,
    pressure_floor=1e-4,  # of the default settings
    law_rate=np.inf,
    side_wall=0.0,
    side_wall_speed=1.0,
)


def _flux() -> sp.Expr:
    return SLOW + (FAST - SLOW) * sp.sin(sp.pi * T / (2 * END)) ** 2


def _under_swell(profile: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Stream function and height under a surface that swells."""
    xi = (X - WIDTH / 2) / SIZE
    h = HEIGHT + SWELL * sp.cosh(xi) ** -2 * sp.cos(RATE * T)
    Q = _flux() + SWELL * RATE * SIZE * sp.tanh(xi) * sp.sin(RATE * T)
    return Q * profile.subs(ETA, Y / h), h


def _shear() -> sp.Expr:
    """F with F'' = (1 - eta) e^(b eta), up to F(1) = 1, and F(0) = F'(0) = 0."""
    b = STEEPNESS
    F = sp.exp(b * ETA) * ((1 - ETA) / b**2 + sp.Rational(2, b**3))
    F = F - F.subs(ETA, 0) - F.diff(ETA).subs(ETA, 0) * ETA
    return F / F.subs(ETA, 1)


def _smooth() -> tuple[sp.Expr, sp.Expr]:
    return _under_swell(_shear())


def _layer() -> tuple[sp.Expr, sp.Expr]:
    slip = ETA - LAYER * (1 - sp.exp(-ETA / LAYER))
    return _under_swell(SLIP * slip / slip.subs(ETA, 1) + (1 - SLIP) * _shear())


def _plug() -> tuple[sp.Expr, sp.Expr]:
    z, bottom = (Y - BAND) / BAND_SIZE, BAND / BAND_SIZE
    whole = 1 + sp.tanh(bottom)
    psi = BAND_SIZE * (sp.log(sp.cosh(z)) - sp.log(sp.cosh(bottom))) + Y * sp.tanh(bottom)
    swing = T / 2 - END / (2 * sp.pi) * sp.sin(sp.pi * T / END)
    path = SLOW * T + (FAST - SLOW) * swing
    h = HEIGHT + SWELL * sp.cos(2 * sp.pi / WIDTH * (X - path))
    return _flux() * psi / whole + REST * (Y / 2 - HEIGHT) * Y, h


KINDS: dict[str, Callable[[], tuple[sp.Expr, sp.Expr]]] = {
    "smooth": _smooth,
    "layer": _layer,
    "plug": _plug,
}


@dataclass(frozen=True)
class Exact:
    """The exact fields of a manufactured flow at x, y, t, all [n] float64.

    Attributes:
        velocity: (u, v).
        height: h of x and t.
        pressure: p.
        jets: value, x, y, t, xx, xy, yy of u, v and p, [7, n, 3]; of p the first three alone.
    """

    velocity: Callable[[Float64, Float64, Float64], tuple[Float64, Float64]]
    height: Callable[[Float64, Float64], Float64]
    pressure: Callable[[Float64, Float64, Float64], Float64]
    jets: Callable[[Float64, Float64, Float64], Float64]

    def source(self, x: Float64, y: Float64, t: Float64) -> tuple[Float64, Float64]:
        """The source term (S_x, S_y): the residuals of momentum without one."""
        jets = torch.as_tensor(self.jets(x, y, t))
        theta = torch.tensor(THETA, dtype=torch.float64)
        e = ops.pointwise_residuals(jets, theta, list(PHYSICS), "strong").numpy()
        return e[:, 0], e[:, 1]

    def inertial_number(self, x: Float64, y: Float64, t: Float64) -> Float64:
        """I."""
        _, along, up, *_ = self.jets(x, y, t)
        rate = np.sqrt(2 * (along[:, 0] ** 2 + up[:, 1] ** 2) + (up[:, 0] + along[:, 1]) ** 2)
        p = np.maximum(self.pressure(x, y, t), PHYSICS.pressure_floor)
        return np.asarray(GRAIN * rate / np.sqrt(p))


@cache
def exact(name: str) -> Exact:
    """The fields of one of the `KINDS`."""
    psi, p, h = expressions(name)
    orders: list[tuple[sp.Symbol, ...]] = [(), (X,), (Y,), (T,), (X, X), (X, Y), (Y, Y)]
    of_u, of_v = [tuple(sorted((*o, Y), key=str)) for o in orders], [(X, *o) for o in orders]
    every = list(dict.fromkeys([*of_u, *of_v]))

    @cache
    def slope(order: tuple[sp.Symbol, ...]) -> sp.Expr:
        return slope(order[:-1]).diff(order[-1]) if order else psi

    slopes = _function((X, Y, T), [slope(order) for order in every])
    of_p = _function((X, Y, T), [p, p.diff(X), p.diff(Y)])

    def jets(x: Float64, y: Float64, t: Float64) -> Float64:
        found = dict(zip(every, slopes(x, y, t), strict=True))
        jet = np.zeros((7, np.size(x), 3))
        for c, (u, v) in enumerate(zip(of_u, of_v, strict=True)):
            jet[c, :, 0], jet[c, :, 1] = found[u], -found[v]
        for c, value in enumerate(of_p(x, y, t)):
            jet[c, :, 2] = value
        return jet

    velocity = _function((X, Y, T), [psi.diff(Y), -psi.diff(X)])
    return Exact(velocity, _function((X, T), h), _function((X, Y, T), p), jets)


def expressions(name: str) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Stream function, pressure and height of the surface as expressions of x, y, t."""
    psi, h = KINDS[name]()
    return psi, (h - Y) * (1 + WAVE * sp.sin(2 * X + Y - T)), h


def _function(symbols: tuple[sp.Symbol, ...], expression: Any) -> Callable[..., Any]:
    """An expression of arrays, broadcast to their common shape."""
    plain = sp.lambdify(symbols, expression, modules="numpy", cse=True)

    def of_arrays(*places: Float64) -> Any:
        found = plain(*places)
        if not isinstance(found, (list, tuple)):
            return found
        return [part + 0 * places[0] for part in found]

    return of_arrays
