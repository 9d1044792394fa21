"""The strongest rival in torch: Taylor jets written by hand, with torch.compile or without.

One pass carries the value and the derivatives by x, y, t (and xx, xy, yy in the strong form) of the
network through its layers, all channels of a layer in one matrix product. autograd differentiates
the loss once. The step has the network, loss and Adam of `bench.steps`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import torch
from torch import Tensor
from torch.nn.functional import softplus

from bench import taylor
from bench.steps import ETA_MAX, ETA_MIN, P_FLOOR, D, Task, U, adam

Jet = list[Tensor]  # value, x, y, t (, xx, xy, yy)


def taylor_network(params: Tensor, points: Tensor, widths: list[int], channels: int) -> Jet:
    """Raw outputs [B, K] of each channel."""
    start = 0
    jet: Jet = []
    for layer, (n_in, n_out) in enumerate(pairwise(widths)):
        W = params[start : start + n_out * n_in].view(n_out, n_in)
        b = params[start + n_out * n_in : start + n_out * (n_in + 1)]
        start += n_out * (n_in + 1)
        if layer == 0:
            value = points @ W.T + b
            first = [W[:, i].expand_as(value) for i in range(3)]
            jet = [value, *first, *[torch.zeros_like(value)] * (channels - 4)]
        else:
            value, *rest = (torch.cat(taylor.swish(jet, torch.sigmoid)) @ W.T).chunk(channels)
            jet = [value + b, *rest]
    return jet


def _friction(gamma_dot: Tensor, p: Tensor, theta: Tensor) -> tuple[Tensor, Tensor]:
    """mu(I) and I d mu/dI."""
    I = D * gamma_dot / torch.sqrt(p.abs().clamp(min=P_FLOOR))
    mu_s, mu_2, I_0 = theta.unbind()
    part = I / (I_0 + I)
    return mu_s + (mu_2 - mu_s) * part, (mu_2 - mu_s) * part * (1 - part)


def _strong(jet: Jet, theta: Tensor) -> list[Tensor]:
    def viscosity(gamma_dot: Tensor, p: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        mu, mu_I = _friction(gamma_dot, p, theta)
        raw = mu * p / gamma_dot
        flowing = (raw >= ETA_MIN) & (raw <= ETA_MAX)
        by_gamma = torch.where(flowing, (mu_I - mu) * p / gamma_dot**2, 0.0)
        above = p.abs() > P_FLOOR
        by_p = torch.where(flowing, (mu - torch.where(above, 0.5 * mu_I, 0.0)) / gamma_dot, 0.0)
        return raw.clamp(ETA_MIN, ETA_MAX), by_gamma, by_p

    return taylor.strong(jet, viscosity, torch.sqrt)


def _mixed(jet: Jet, theta: Tensor) -> list[Tensor]:
    def friction(gamma_dot: Tensor, p: Tensor) -> Tensor:
        return _friction(gamma_dot, p, theta)[0]

    return taylor.mixed(jet, friction, torch.sqrt, torch.sigmoid, softplus)


def jets_step(task: Task, compiled: bool = False) -> Callable[[], Tensor]:
    """Loss by Taylor jets, its gradient by autograd."""
    params, theta, optimizer = adam(task)
    residuals = _strong if task.form == "strong" else _mixed
    channels = 7 if task.form == "strong" else 4

    def loss(theta: Tensor, points: Tensor, velocity: Tensor) -> Tensor:
        jet = taylor_network(params, points, task.widths, channels)
        e = [U * jet[0][:, k] - velocity[:, k] for k in (0, 1)] + residuals(jet, theta)
        return torch.stack([(r**2).mean() for r in e]).sum() / 2

    if compiled:
        loss = torch.compile(loss, dynamic=False)

    def step() -> Tensor:
        optimizer.zero_grad()
        value = loss(theta, task.points, task.velocity)
        value.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        return value.detach()

    return step
