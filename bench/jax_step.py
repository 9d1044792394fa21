"""The strongest rival: JAX, jitted, with Taylor jets written by hand, both forms.

A jet is the list of channels [value, x, y, t] of an array, in the strong form also [xx, xy, yy].
Optional: needs `pip install jax`. The step has the network, loss and Adam of `bench.steps`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import torch
from torch import Tensor

from bench.steps import ETA_MAX, ETA_MIN, G_X, G_Y, P_FLOOR, D, P, Task, U
from granpinn.reference.equations import SMOOTHING

Array = Any
SECOND = ((1, 1), (1, 2), (2, 2))


def _jets(params: Array, points: Array, widths: list[int], channels: int) -> list[Array]:
    """Raw outputs [B, K] of each channel; the products of all channels as one matrix product."""
    start, jet = 0, []
    for layer, (n_in, n_out) in enumerate(pairwise(widths)):
        W = params[start : start + n_out * n_in].reshape(n_out, n_in)
        b = params[start + n_out * n_in : start + n_out * (n_in + 1)]
        start += n_out * (n_in + 1)
        if layer == 0:
            value = points @ W.T + b
            first = [jnp.broadcast_to(W[:, i], value.shape) for i in range(3)]
            jet = [value, *first, *[jnp.zeros_like(value)] * (channels - 4)]
        else:
            stacked = jnp.concatenate(_swish(jet)) @ W.T
            value, *rest = jnp.split(stacked, channels)
            jet = [value + b, *rest]
    return jet


def _swish(z: list[Array]) -> list[Array]:
    s = jax.nn.sigmoid(z[0])
    q = s * (1 - s)
    f1 = s + z[0] * q
    a = [z[0] * s] + [f1 * z_i for z_i in z[1:4]]
    if len(z) > 4:
        f2 = q * (2 + z[0] * (1 - 2 * s))
        a += [f2 * z[i] * z[j] + f1 * z_ij for (i, j), z_ij in zip(SECOND, z[4:], strict=True)]
    return a


def _friction(gamma_dot: Array, p: Array, theta: Array) -> Array:
    I = D * gamma_dot / jnp.sqrt(jnp.maximum(jnp.abs(p), P_FLOOR))
    return theta[0] + (theta[1] - theta[0]) / (1 + theta[2] / I)


def _eta(gamma_dot: Array, p: Array, theta: Array) -> Array:
    return jnp.clip(_friction(gamma_dot, p, theta) * p / gamma_dot, ETA_MIN, ETA_MAX)


def _strong(jet: list[Array], theta: Array) -> list[Array]:
    """Residuals of the strong form from raw outputs."""
    u, u_x, u_y, u_t, u_xx, u_xy, u_yy = (U * c[:, 0] for c in jet)
    v, v_x, v_y, v_t, v_xx, v_xy, v_yy = (U * c[:, 1] for c in jet)
    p, p_x, p_y = (P * c[:, 2] for c in jet[:3])
    shear = u_y + v_x
    gamma_dot = jnp.sqrt(2 * u_x**2 + 2 * v_y**2 + shear**2 + SMOOTHING)
    gamma_x = (2 * u_x * u_xx + 2 * v_y * v_xy + shear * (u_xy + v_xx)) / gamma_dot
    gamma_y = (2 * u_x * u_xy + 2 * v_y * v_yy + shear * (u_yy + v_xy)) / gamma_dot
    eta, pull = jax.vjp(lambda g, q: _eta(g, q, theta), gamma_dot, p)
    by_gamma, by_p = pull(jnp.ones_like(eta))
    eta_x, eta_y = by_gamma * gamma_x + by_p * p_x, by_gamma * gamma_y + by_p * p_y
    div_x = eta * (2 * u_xx + u_yy + v_xy) + 2 * eta_x * u_x + eta_y * shear
    div_y = eta * (v_xx + u_xy + 2 * v_yy) + eta_x * shear + 2 * eta_y * v_y
    return [
        u_t + u * u_x + v * u_y + p_x - div_x - G_X,
        v_t + u * v_x + v * v_y + p_y - div_y - G_Y,
        u_x + v_y,
    ]


def _mixed(jet: list[Array], theta: Array) -> list[Array]:
    """Residuals of the mixed form from raw outputs."""
    u, u_x, u_y, u_t = (U * c[:, 0] for c in jet)
    v, v_x, v_y, v_t = (U * c[:, 1] for c in jet)
    slope = P * jax.nn.sigmoid(jet[0][:, 2])
    p, p_x, p_y = P * jax.nn.softplus(jet[0][:, 2]), slope * jet[1][:, 2], slope * jet[2][:, 2]
    s1, s1_x, s1_y, _ = (c[:, 3] for c in jet)
    s2, s2_x, s2_y, _ = (c[:, 4] for c in jet)
    two_D_1, two_D_2 = u_x - v_y, u_y + v_x
    gamma_dot = jnp.sqrt(two_D_1**2 + two_D_2**2 + SMOOTHING)
    rate = gamma_dot / _friction(gamma_dot, p, theta)
    return [
        u_t + u * u_x + v * u_y + p_x - p_x * s1 - p * s1_x - p_y * s2 - p * s2_y - G_X,
        v_t + u * v_x + v * v_y + p_y - p_x * s2 - p * s2_x + p_y * s1 + p * s1_y - G_Y,
        u_x + v_y,
        rate * s1 - two_D_1,
        rate * s2 - two_D_2,
    ]


def jax_training(task: Task) -> tuple[Callable[[Any], Any], Any]:
    """A function state -> (state, loss), not yet jitted, and the first state."""
    jax.config.update("jax_enable_x64", task.params.dtype == torch.float64)
    channels = 7 if task.form == "strong" else 4
    residuals = _strong if task.form == "strong" else _mixed
    points, velocity = jnp.asarray(task.points.numpy()), jnp.asarray(task.velocity.numpy())

    def loss(unknowns: tuple[Array, Array]) -> Array:
        params, theta = unknowns
        jet = _jets(params, points, task.widths, channels)
        e = [U * jet[0][:, 0] - velocity[:, 0], U * jet[0][:, 1] - velocity[:, 1]]
        return sum(jnp.mean(r**2) for r in e + residuals(jet, theta)) / 2

    def advance_once(state: Any) -> tuple[Any, Array]:
        unknowns, first, second, k = state
        value, gradient = jax.value_and_grad(loss)(unknowns)
        k = k + 1
        tree = jax.tree_util.tree_map
        first = tree(lambda m, g: 0.9 * m + 0.1 * g, first, gradient)
        second = tree(lambda v, g: 0.999 * v + 0.001 * g * g, second, gradient)

        def update(a: Array, m: Array, v: Array) -> Array:
            return a - 5e-4 * (m / (1 - 0.9**k)) / (jnp.sqrt(v / (1 - 0.999**k)) + 1e-8)

        return (tree(update, unknowns, first, second), first, second, k), value

    unknowns = (jnp.asarray(task.params.numpy()), jnp.asarray(task.theta.numpy()))
    zeros = jax.tree_util.tree_map(jnp.zeros_like, unknowns)
    return advance_once, (unknowns, zeros, zeros, jnp.zeros((), points.dtype))


def jax_step(task: Task) -> Callable[[], Tensor]:
    """One jitted step; JAX uses every core that the process may use."""
    once, state = jax_training(task)
    advance: Any = jax.jit(once)

    def step() -> Tensor:
        nonlocal state
        state, value = advance(state)
        return torch.tensor(float(value), dtype=task.params.dtype)

    return step
