"""Does a flow obey its own momentum balance? Finite differences on every cell of the solver's grid.

For three frames around a time, with density 1,
    e = dv/dt + v.grad v + grad p - div(2 eta D) - g - f,   eta = min(mu(I) p / gamma_dot, eta_max),
with the friction of side walls f = -k p v / |v|, if there are any,
by central differences of cell-centered values, where the 5 x 5 cells around hold nothing but
grains. The friction enters linearly: div(2 eta D) = mu_s A + (mu_2 - mu_s) B away from the clamp,
so that mu_s and mu_2 follow from a robust regression with the true pressure.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn.physics.constants import side_wall
from granpinn.simulation import Collapse, Engine

Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

REACH = 2  # cells that a second difference of differences looks away
FLOWING = 0.5  # D2 above which the regression is done
SWEEPS = 60  # of the reweighting


class BalanceFrame(NamedTuple):
    """Cell-centered fields [ny, nx] at a time."""

    t: float
    u: Array
    v: Array
    p: Array
    c: Array


class Balance(NamedTuple):
    """The momentum balance at many points [n, 2]: e = rest - mu_s A - (mu_2 - mu_s) B, unclamped.

    residual: |e| at the true parameters with the clamp [n]; flowing: D2 > 0.5 [n].
    """

    rest: Array
    A: Array
    B: Array
    residual: Array
    flowing: BoolArray


def frames(collapse: Collapse, times: Sequence[float], interval: float) -> list[list[BalanceFrame]]:
    """Three frames, `interval` apart, around every time."""
    engine = Engine(collapse)
    triples = []
    for time in times:
        triple = []
        for moment in (time - interval, time, time + interval):
            while moment - engine.time > 1e-9:
                engine.step(moment - engine.time)
            s = engine.state()
            triple.append(BalanceFrame(moment, s.u_center, s.v_center, s.p, s.c))
        ny, nx = np.min([frame.c.shape for frame in triple], axis=0)
        triples.append([BalanceFrame(f.t, *(a[:ny, :nx] for a in f[1:])) for f in triple])
    return triples


def momentum_balance(triple: list[BalanceFrame], collapse: Collapse) -> Balance:
    """The balance at the middle of three frames."""
    s = collapse.resolved()
    assert s.eta_max is not None  # resolved
    h, (before, now, after) = s.spacing, triple

    def x_(a: Array) -> Array:
        return (np.roll(a, -1, 1) - np.roll(a, 1, 1)) / (2 * h)

    def y_(a: Array) -> Array:
        return (np.roll(a, -1, 0) - np.roll(a, 1, 0)) / (2 * h)

    _, u, v, p, _ = now
    u_x, u_y, v_x, v_y = x_(u), y_(u), x_(v), y_(v)
    D_1, D_2 = 0.5 * (u_x - v_y), 0.5 * (u_y + v_x)
    gamma_dot = np.sqrt(2 * (u_x**2 + v_y**2) + 4 * D_2**2) + 1e-12
    positive = np.maximum(p, 1e-12)
    I = s.d * gamma_dot / np.sqrt(positive / s.density)
    share = I / (I + s.I0)

    def force(eta: Array) -> Array:
        return np.stack(
            [x_(2 * eta * D_1) + y_(2 * eta * D_2), x_(2 * eta * D_2) - y_(2 * eta * D_1)], -1
        )

    span = after.t - before.t
    acceleration = [
        (after.u - before.u) / span + u * u_x + v * u_y - s.gravity[0],
        (after.v - before.v) / span + u * v_x + v * v_y - s.gravity[1],
    ]
    rest = s.density * np.stack(acceleration, -1) + np.stack([x_(p), y_(p)], -1)
    if s.wall_gap is not None:
        assert s.wall_friction is not None  # resolved
        friction = side_wall(s.wall_friction, s.wall_gap) * p / (np.hypot(u, v) + 1e-12)
        rest = rest + np.stack([friction * u, friction * v], -1)
    mu = s.mu_s + (s.mu_2 - s.mu_s) * share
    e = rest - force(np.minimum(mu * positive / gamma_dot, s.eta_max))
    inside = surrounded(triple)
    A, B = force(positive / gamma_dot), force(share * positive / gamma_dot)
    return Balance(
        rest[inside],
        A[inside],
        B[inside],
        np.linalg.norm(e, axis=-1)[inside],
        (gamma_dot / np.sqrt(2) > FLOWING)[inside],
    )


def surrounded(triple: list[BalanceFrame]) -> BoolArray:
    """Cells that hold nothing but grains in all three frames, and whose neighbours do now."""
    inside: BoolArray = np.logical_and.reduce([frame.c == 1 for frame in triple])
    full = triple[1].c == 1
    reach = range(-REACH, REACH + 1)
    for dj in reach:
        for di in reach:
            inside &= np.roll(full, (dj, di), (0, 1))
    inside[:REACH] = inside[-REACH:] = False
    inside[:, :REACH] = inside[:, -REACH:] = False
    return inside


def merge(balances: Sequence[Balance]) -> Balance:
    return Balance(*(np.concatenate(parts) for parts in zip(*balances, strict=True)))


def regression(balance: Balance) -> tuple[float, float]:
    """mu_s and mu_2 with the least sum of |e| (iteratively reweighted) where the grains flow."""
    some = balance.flowing
    matrix = np.stack([balance.A[some].ravel(), balance.B[some].ravel()], axis=1)
    right = balance.rest[some].ravel()
    weight: npt.NDArray[np.floating] = np.ones_like(right)
    solution = np.zeros(2)
    for _ in range(SWEEPS):
        solution = np.linalg.lstsq(matrix * weight[:, None], right * weight, rcond=None)[0]
        error = np.abs(right - matrix @ solution)
        scale = 1.5 * np.median(error)
        weight = 1 / np.sqrt(np.maximum(error, 1e-3 * scale) / scale)
    return float(solution[0]), float(solution.sum())
