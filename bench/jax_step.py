"""The strongest rival on the CPU: JAX, jitted, with hand-written Taylor jets, both forms.

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

from bench import taylor
from bench.steps import ETA_MAX, ETA_MIN, P_FLOOR, D, Task, U

Array = Any


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
            stacked = jnp.concatenate(taylor.swish(jet, jax.nn.sigmoid)) @ W.T
            value, *rest = jnp.split(stacked, channels)
            jet = [value + b, *rest]
    return jet


def _friction(gamma_dot: Array, p: Array, theta: Array) -> Array:
    I = D * gamma_dot / jnp.sqrt(jnp.maximum(jnp.abs(p), P_FLOOR))
    return theta[0] + (theta[1] - theta[0]) / (1 + theta[2] / I)


def _eta(gamma_dot: Array, p: Array, theta: Array) -> Array:
    return jnp.clip(_friction(gamma_dot, p, theta) * p / gamma_dot, ETA_MIN, ETA_MAX)


def _strong(jet: list[Array], theta: Array) -> list[Array]:
    def viscosity(gamma_dot: Array, p: Array) -> tuple[Array, Array, Array]:
        eta, pull = jax.vjp(lambda g, q: _eta(g, q, theta), gamma_dot, p)
        return (eta, *pull(jnp.ones_like(eta)))

    return taylor.strong(jet, viscosity, jnp.sqrt)


def _mixed(jet: list[Array], theta: Array) -> list[Array]:
    def friction(gamma_dot: Array, p: Array) -> Array:
        return _friction(gamma_dot, p, theta)

    return taylor.mixed(jet, friction, jnp.sqrt, jax.nn.sigmoid, jax.nn.softplus)


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
