"""The friction laws for manufactured fields: smooth branches that sympy can differentiate."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import sympy as sp

MU_S, MU_2, I_0 = sp.Rational(3, 8), sp.Rational(11, 16), sp.Rational(9, 32)
MU_INF, ALPHA, I_1 = sp.Rational(1, 16), sp.Rational(15, 8), sp.Rational(1, 16)
B, N = sp.Rational(5, 8), sp.Rational(3, 4)
C = [sp.Rational(k, 16) for k in (7, 5, 6, 8, 7, 10, 9, 12)]
I_LOW, I_HIGH = sp.Rational(1, 20), sp.Rational(1, 8)

THETA = {
    "mu_of_i": (MU_S, MU_2, I_0),
    "coulomb": (MU_S,),
    "regularised": (MU_S, MU_2, I_0, MU_INF, ALPHA, I_1),
    "power": (MU_S, B, N),
    "cohesive": (MU_S, MU_2, I_0, sp.Rational(1, 8)),
    "free": (*C, I_LOW, I_HIGH),
}

COHESION = {"cohesive": THETA["cohesive"][3]}  # of the laws that have one

Branch = Callable[[sp.Expr], sp.Expr]  # mu of I


@cache
def branches(law: str) -> tuple[tuple[float, ...], tuple[Branch, ...]]:
    """The values of I between two branches, ascending, and the branches, one more."""
    if law in ("mu_of_i", "cohesive"):
        return (), (lambda I: MU_S + (MU_2 - MU_S) / (1 + I_0 / I),)
    if law == "coulomb":
        return (), (lambda I: MU_S + 0 * I,)
    if law == "power":
        return (), (lambda I: MU_S + B * I**N,)
    if law == "regularised":
        return (float(I_1),), (_creep, _inertial)
    edges = [I_LOW * (I_HIGH / I_LOW) ** sp.Rational(j, 5) for j in range(6)]
    inner = [_spline(j) for j in range(5)]
    ends = [inner[k](edge) for k, edge in ((0, I_LOW), (-1, I_HIGH))]
    low, high = (lambda I, end=end: end + 0 * I for end in ends)
    return tuple(float(edge) for edge in edges), (low, *inner, high)


def _inertial(I: sp.Expr) -> sp.Expr:
    return (MU_S * I_0 + MU_2 * I + MU_INF * I**2) / (I_0 + I)


def _creep(I: sp.Expr) -> sp.Expr:
    A = I_1 * sp.exp(ALPHA / _inertial(I_1) ** 2)
    return sp.sqrt(ALPHA / sp.log(A / I))


def _spline(interval: int) -> Branch:
    """The polynomial of one interval of the B-spline."""
    X = sp.Symbol("X")
    basis = sp.bspline_basis_set(3, range(-3, 9), X)
    inside = interval + sp.Rational(1, 2)
    mu = sum(
        c * next(piece for piece, where in B_k.args if where.subs(X, inside) == True)  # noqa: E712
        for c, B_k in zip(C, basis, strict=True)
    )
    scale = 5 / sp.log(I_HIGH / I_LOW)
    return lambda I: mu.subs(X, scale * sp.log(I / I_LOW))
