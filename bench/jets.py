"""The strongest rival in torch: Taylor jets written by hand, with torch.compile or without.

One pass carries the value and the derivatives by x, y, t (and xx, xy, yy in the strong form) of the
network through its layers, all channels of a layer in one matrix product. autograd differentiates
the loss once. The step is that of `bench.steps`: same network, loss and Adam.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import torch
from torch import Tensor
from torch.nn.functional import softplus

from bench.steps import ETA_MAX, ETA_MIN, G_X, G_Y, P_FLOOR, SMOOTHING, D, P, Task, U, adam

Jet = list[Tensor]  # value, x, y, t (, xx, xy, yy)
SECOND = ((1, 1), (1, 2), (2, 2))


def _swish(z: Jet) -> Jet:
    s = torch.sigmoid(z[0])
    q = s * (1 - s)
    f1 = s + z[0] * q
    a = [z[0] * s] + [f1 * z_i for z_i in z[1:4]]
    if len(z) > 4:
        f2 = q * (2 + z[0] * (1 - 2 * s))
        a += [f2 * z[i] * z[j] + f1 * z_ij for (i, j), z_ij in zip(SECOND, z[4:], strict=True)]
    return a


def _network(params: Tensor, points: Tensor, widths: list[int], channels: int) -> Jet:
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
            value, *rest = (torch.cat(_swish(jet)) @ W.T).chunk(channels)
            jet = [value + b, *rest]
    return jet


def _friction(gamma_dot: Tensor, p: Tensor, theta: Tensor) -> tuple[Tensor, Tensor]:
    """mu(I) and I d mu/dI."""
    I = D * gamma_dot / torch.sqrt(p.abs().clamp(min=P_FLOOR))  # noqa: E741
    mu_s, mu_2, I_0 = theta.unbind()
    part = I / (I_0 + I)
    return mu_s + (mu_2 - mu_s) * part, (mu_2 - mu_s) * part * (1 - part)


def _strong(jet: Jet, theta: Tensor) -> list[Tensor]:
    u, u_x, u_y, u_t, u_xx, u_xy, u_yy = (U * c[:, 0] for c in jet)
    v, v_x, v_y, v_t, v_xx, v_xy, v_yy = (U * c[:, 1] for c in jet)
    p, p_x, p_y = (P * c[:, 2] for c in jet[:3])
    shear = u_y + v_x
    gamma_dot = torch.sqrt(2 * u_x**2 + 2 * v_y**2 + shear**2 + SMOOTHING)
    gamma_x = (2 * u_x * u_xx + 2 * v_y * v_xy + shear * (u_xy + v_xx)) / gamma_dot
    gamma_y = (2 * u_x * u_xy + 2 * v_y * v_yy + shear * (u_yy + v_xy)) / gamma_dot
    mu, mu_I = _friction(gamma_dot, p, theta)
    raw = mu * p / gamma_dot
    flowing = (raw >= ETA_MIN) & (raw <= ETA_MAX)
    by_gamma = torch.where(flowing, (mu_I - mu) * p / gamma_dot**2, 0.0)
    above = p.abs() > P_FLOOR
    by_p = torch.where(flowing, (mu - torch.where(above, 0.5 * mu_I, 0.0)) / gamma_dot, 0.0)
    eta = raw.clamp(ETA_MIN, ETA_MAX)
    eta_x, eta_y = by_gamma * gamma_x + by_p * p_x, by_gamma * gamma_y + by_p * p_y
    div_x = eta * (2 * u_xx + u_yy + v_xy) + 2 * eta_x * u_x + eta_y * shear
    div_y = eta * (v_xx + u_xy + 2 * v_yy) + eta_x * shear + 2 * eta_y * v_y
    return [
        u_t + u * u_x + v * u_y + p_x - div_x - G_X,
        v_t + u * v_x + v * v_y + p_y - div_y - G_Y,
        u_x + v_y,
    ]


def _mixed(jet: Jet, theta: Tensor) -> list[Tensor]:
    u, u_x, u_y, u_t = (U * c[:, 0] for c in jet)
    v, v_x, v_y, v_t = (U * c[:, 1] for c in jet)
    slope = P * torch.sigmoid(jet[0][:, 2])
    p, p_x, p_y = P * softplus(jet[0][:, 2]), slope * jet[1][:, 2], slope * jet[2][:, 2]
    s1, s1_x, s1_y, _ = (c[:, 3] for c in jet)
    s2, s2_x, s2_y, _ = (c[:, 4] for c in jet)
    two_D_1, two_D_2 = u_x - v_y, u_y + v_x
    gamma_dot = torch.sqrt(two_D_1**2 + two_D_2**2 + SMOOTHING)
    rate = gamma_dot / _friction(gamma_dot, p, theta)[0]
    return [
        u_t + u * u_x + v * u_y + p_x - p_x * s1 - p * s1_x - p_y * s2 - p * s2_y - G_X,
        v_t + u * v_x + v * v_y + p_y - p_x * s2 - p * s2_x + p_y * s1 + p * s1_y - G_Y,
        u_x + v_y,
        rate * s1 - two_D_1,
        rate * s2 - two_D_2,
    ]


def jets_step(task: Task, compiled: bool = False) -> Callable[[], Tensor]:
    params, theta, optimizer = adam(task)
    channels, residuals = (7, _strong) if task.form == "strong" else (4, _mixed)
    widths = task.widths

    def loss(params: Tensor, theta: Tensor, points: Tensor, velocity: Tensor) -> Tensor:
        jet = _network(params, points, widths, channels)
        e = [U * jet[0][:, k] - velocity[:, k] for k in (0, 1)] + residuals(jet, theta)
        return torch.stack([(r**2).mean() for r in e]).sum() / 2

    if compiled:
        loss = torch.compile(loss, dynamic=False)

    def step() -> Tensor:
        optimizer.zero_grad()
        value = loss(params, theta, task.points, task.velocity)
        value.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        return value.detach()

    return step
