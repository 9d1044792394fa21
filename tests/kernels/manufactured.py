"""Manufactured fields: sympy derives the values that oracle and kernels must reproduce (V-1).

u, v, p, s_1, s_2 are closed expressions that need not solve the equations: the residual that sympy
derives from the printed equations is their source term. Reference values are evaluated in
extended precision (numpy.longdouble), so that their own rounding stays below the gate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy as sp
import torch

from granpinn.physics.laws import LAWS

from .manufactured_laws import COHESION, THETA, branches

x, y, t = sp.symbols("x y t", real=True)

# Values that every field takes to both limits of the viscosity and to both sides of p_floor;
# fractions of powers of two, so that sympy and the kernels work with the same numbers.
D, G_X, G_Y = sp.Rational(3, 64), sp.Rational(5, 16), sp.Rational(-7, 8)
ETA_MIN, ETA_MAX = sp.Rational(1, 8), sp.Rational(1, 2)
U, P, P_FLOOR = sp.Rational(7, 4), sp.Rational(3, 4), sp.Rational(1, 2)
V_FACTOR = sp.Rational(2, 3)
LAW_RATE = sp.Rational(5, 4)
WALL, WALL_SPEED = sp.Rational(5, 8), sp.Rational(1, 4)
CONSTANTS = (D, G_X, G_Y, ETA_MIN, ETA_MAX, U, P, P_FLOOR, LAW_RATE, WALL, WALL_SPEED, V_FACTOR)
PHYSICS = [float(value) for value in CONSTANTS]
SMOOTHING = 1e-12

FIELDS = {
    "waves": (
        sp.sin(2 * x + t) * sp.cos(y) + y**2 / 3,
        sp.cos(x - y) * sp.exp(-t / 2) + x * y / 5,
        1 + sp.sin(x) * sp.cos(2 * y - t) / 2 + y / 4,
        sp.sin(x * y + t) / 3 + x / 7,
        sp.cos(x + 2 * y) * sp.exp(-t) / 4 + y / 9,
    ),
    "shear layer": (
        sp.tanh(3 * (y - x / 3 - t / 4)) + x / 2,
        sp.exp(-((x - y) ** 2)) / 3 + t * y / 4,
        sp.exp(-y) * (1 + x**2 / 4) + t / 8,
        -sp.tanh(2 * y - x + t) / 3,
        sp.exp(-(x**2)) * sp.sin(y + t) / 5,
    ),
    # p changes sign in the strong form; the mixed form takes p + 1 (softplus is positive)
    "falling column": (
        x**2 * y / 2 - t * x * y**2 / 3 + sp.sin(3 * t),
        -t / 2 + x * y**2 / 4 - y**3 * t / 6 + x / 3,
        y**2 / 2 - x * y / 3 + sp.cos(4 * x + t) / 3 - sp.Rational(1, 8),
        x * y / 3 - t / 5,
        (x**2 - y * t) / 4,
    ),
}

# Every field with mu(I), and the other laws with one field. Cohesive grains hold a stress under
# tension too.
CASES = [(name, "mu_of_i") for name in FIELDS] + [
    ("falling column" if law in COHESION else "shear layer", law)
    for law in LAWS
    if law != "mu_of_i"
]


@dataclass(frozen=True)
class Manufactured:
    """A field in the variables of one residual form.

    raw: the network's raw outputs z as expressions.
    variants: the residuals under each assumption about floor and limits, for each branch of the
        law.
    """

    form: str
    law: str
    raw: list[sp.Expr]
    p: sp.Expr
    gamma_dot: sp.Expr
    variants: dict[tuple[str, int], list[sp.Expr]]

    @property
    def theta(self) -> torch.Tensor:
        """Parameters of the law."""
        return torch.tensor([float(value) for value in THETA[self.law]], dtype=torch.float64)

    def points(self, n: int) -> np.ndarray:
        return np.random.default_rng(7).uniform(-1, 1, (n, 3)).astype(np.float64)

    def raw_jets(self, points: np.ndarray) -> torch.Tensor:
        """Jets [C, N, K] of the raw outputs, differentiated by sympy: 7 channels or 4."""
        orders: list[tuple[sp.Symbol, ...]] = [(), (x,), (y,), (t,)]
        if self.form == "strong":
            orders += [(x, x), (x, y), (y, y)]
        jets = [[sp.diff(z, *order) if order else z for z in self.raw] for order in orders]
        return torch.from_numpy(
            np.stack([_evaluate(channel, points).astype(np.float64) for channel in jets])
        )

    def raw_network(self) -> torch.nn.Module:
        """The raw outputs as a differentiable torch function of points [N, 3]."""
        return _TorchField(self.raw)

    def residuals(self, points: np.ndarray) -> np.ndarray:
        """The residuals [N, R] in extended precision, each point with its own variant."""
        d, eta_min, eta_max, p_floor = (float(v) for v in (D, ETA_MIN, ETA_MAX, P_FLOOR))
        p, gamma_dot = _evaluate([self.p, self.gamma_dot], points).T
        inertia = d * gamma_dot / np.sqrt(np.maximum(np.abs(p), p_floor))
        edges, curves = branches(self.law)
        branch = np.searchsorted(edges, inertia)
        I = sp.Symbol("I")
        mu = np.empty_like(inertia)
        for k, curve in enumerate(curves):
            value = sp.lambdify(I, curve(I), modules="numpy")(inertia[branch == k])
            mu[branch == k] = value
        eta = (mu * p + float(COHESION.get(self.law, 0))) / gamma_dot
        holds = {"floored": np.abs(p) < p_floor, "eta_min": eta < eta_min, "eta_max": eta > eta_max}
        chosen = np.full(len(points), "flowing", dtype=object)
        for name in ("floored", "eta_min", "eta_max"):
            if (name, 0) in self.variants:
                chosen[holds[name]] = name
        missing = {name for name, _ in self.variants} - set(chosen)
        assert not missing, f"no point exercises {missing}"
        missing = set(range(len(curves))) - set(branch[np.isin(chosen, ("flowing", "floored"))])
        assert not missing, f"no point exercises the branches {missing}"
        out = np.empty((len(points), len(self.variants["flowing", 0])), dtype=np.longdouble)
        for (name, k), expressions in self.variants.items():
            here = chosen == name
            if name in ("flowing", "floored"):
                here &= branch == k
            if here.any():
                out[here] = _evaluate(expressions, points[here])
        return out


@cache
def exact(name: str, form: str, law: str, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a field and its residuals there, which take longer than those of the kernels."""
    case = manufactured(name, form, law)
    points = case.points(n)
    return points, case.residuals(points)


@cache
def manufactured(name: str, form: str, law: str = "mu_of_i") -> Manufactured:
    u, v, p, s_1, s_2 = FIELDS[name]
    if form == "mixed" and name == "falling column":
        p = p + 1
    u_x, u_y, v_x, v_y = u.diff(x), u.diff(y), v.diff(x), v.diff(y)
    c = COHESION.get(law, sp.Integer(0))
    friction = WALL * p / sp.sqrt(u**2 + v**2 + WALL_SPEED**2)
    inertial_u = u.diff(t) + u * u_x + v * u_y + p.diff(x) - G_X + friction * u
    inertial_v = v.diff(t) + u * v_x + v * v_y + p.diff(y) - G_Y + friction * v
    if form == "strong":
        rate = sp.Matrix([[u_x, (u_y + v_x) / 2], [(u_y + v_x) / 2, v_y]])
        gamma_dot = sp.sqrt(2 * sum(entry**2 for entry in rate) + SMOOTHING)
        eta = {
            (kind, k): (c + mu(D * gamma_dot / sp.sqrt(floored_p)) * p) / gamma_dot
            for kind, floored_p in (("flowing", p), ("floored", P_FLOOR))
            for k, mu in enumerate(branches(law)[1])
        }
        eta |= {("eta_min", 0): ETA_MIN, ("eta_max", 0): ETA_MAX}
        variants = {}
        for variant, viscosity in eta.items():
            tau = 2 * viscosity * rate
            variants[variant] = [
                inertial_u - tau[0, 0].diff(x) - tau[0, 1].diff(y),
                inertial_v - tau[1, 0].diff(x) - tau[1, 1].diff(y),
                u_x + v_y,
            ]
        raw = [u / U, v / (U * V_FACTOR), p / P]
    else:
        D_1, D_2 = (u_x - v_y) / 2, (u_y + v_x) / 2
        gamma_dot = sp.sqrt(4 * (D_1**2 + D_2**2) + SMOOTHING)
        limit = 1 / sp.sqrt(1 + (gamma_dot / LAW_RATE) ** 2)
        variants = {}
        for kind, floored_p in (("flowing", p), ("floored", P_FLOOR)):
            for k, curve in enumerate(branches(law)[1]):
                strength = c + curve(D * gamma_dot / sp.sqrt(floored_p)) * p
                variants[kind, k] = [
                    inertial_u - (p * s_1).diff(x) - (p * s_2).diff(y),
                    inertial_v - (p * s_2).diff(x) + (p * s_1).diff(y),
                    u_x + v_y,
                    limit * (gamma_dot * p * s_1 / strength - 2 * D_1),
                    limit * (gamma_dot * p * s_2 / strength - 2 * D_2),
                ]
        raw = [u / U, v / (U * V_FACTOR), sp.log(sp.exp(p / P) - 1), s_1, s_2]
    return Manufactured(form, law, raw, p, gamma_dot, variants)


def _evaluate(expressions: list[sp.Expr], points: np.ndarray) -> np.ndarray:
    """Expressions at points [N, 3] -> [N, len(expressions)] in extended precision."""
    function = sp.lambdify((x, y, t), expressions, modules="numpy", cse=True)
    columns = function(*points.astype(np.longdouble).T)
    return np.stack([np.broadcast_to(c, len(points)) for c in columns], axis=1)


class _TorchField(torch.nn.Module):
    def __init__(self, expressions: list[sp.Expr]) -> None:
        super().__init__()
        names = ("sin", "cos", "tanh", "exp", "log", "sqrt")
        functions = {name: getattr(torch, name) for name in names}
        self.function = sp.lambdify((x, y, t), expressions, modules=[functions], cse=True)

    def forward(self, points: torch.Tensor) -> torch.Tensor:
        return torch.stack(self.function(*points.unbind(1)), dim=1)
