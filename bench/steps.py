"""One optimization step, loss + gradients + Adam update, as granpinn and as a PINN user write it.

All train the paper's network, 3x250 swish, on the same points with the same loss (terms 0, 2, 3
and, in the mixed form, 4 of `granpinn.reference.loss`, unit weights, no surface points). On a GPU
no step waits for the device, so that it can be captured: granpinn's Adam is its own, the rivals'
is torch's fused one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor
from torch.nn.functional import logsigmoid, silu

from granpinn.kernels.network import NetworkSpec
from granpinn.physics.laws import DEFAULT
from granpinn.physics.terms import LossPoints
from granpinn.reference import friction, inertial_number, viscosity

HIDDEN = [250, 250, 250]
D, G_X, G_Y, ETA_MIN, ETA_MAX, U, P, P_FLOOR = [0.02, 0.0, -1.0, 0.0, 1e4, 1.0, 1.0, 1e-4]
PHYSICS = [D, G_X, G_Y, ETA_MIN, ETA_MAX, U, P, P_FLOOR, math.inf, 0.0, 1.0]
THETA = (0.4, 0.64, 0.3)
SMOOTHING = 1e-12

Network = Callable[[Tensor], Tensor]


@dataclass(frozen=True)
class Task:
    """Parameters and one minibatch of B points; an ensemble has a leading axis E everywhere."""

    form: str
    params: Tensor  # [P]
    theta: Tensor  # [3]
    points: Tensor  # [B, 3]
    velocity: Tensor  # [B, 2]

    @property
    def count(self) -> int:
        """Points of all members."""
        return self.points.numel() // 3

    @property
    def widths(self) -> list[int]:
        return [3, *HIDDEN, 3 if self.form == "strong" else 5]

    @property
    def spec(self) -> NetworkSpec:
        return NetworkSpec(tuple(self.widths), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), self.form)

    @property
    def batch(self) -> LossPoints:
        """The points with unit weights, and no surface points."""
        none = self.points.new_empty(0, 3)
        weights = torch.ones_like(self.velocity)
        return LossPoints(self.points, self.velocity, weights, none, none[:, 0])

    @property
    def flop(self) -> float:
        """Operations of the products: channels x 2 x weights forward, twice as many backward."""
        weights = sum(n_in * n_out for n_in, n_out in pairwise(self.widths))
        channels = 7 if self.form == "strong" else 4
        return 3.0 * channels * 2 * weights * self.count

    def to(self, device: torch.device) -> Task:
        tensors = {name: getattr(self, name).to(device) for name in TENSORS}
        return replace(self, **tensors)

    def ensemble(self, members: int) -> Task:
        """A task with the points in equal parts, one for each of `members` equal networks."""
        parts = {
            name: getattr(self, name).view(members, -1, 3 if name == "points" else 2)
            for name in ("points", "velocity")
        }
        copies = {name: getattr(self, name).repeat(members, 1) for name in ("params", "theta")}
        return replace(self, **parts, **copies)


TENSORS = ("params", "theta", "points", "velocity")


def make_task(form: str, points: int, dtype: torch.dtype = torch.float32) -> Task:
    rng = torch.Generator().manual_seed(0)
    widths = [3, *HIDDEN, 3 if form == "strong" else 5]
    layers = []
    for n_in, n_out in pairwise(widths):
        layers.append(torch.randn(n_out * n_in, generator=rng) * (2 / n_in) ** 0.5)
        layers.append(torch.randn(n_out, generator=rng) * 0.1)
    return Task(
        form=form,
        params=torch.cat(layers).to(dtype),
        theta=torch.tensor(THETA, dtype=dtype),
        points=(2 * torch.rand(points, 3, generator=rng) - 1).to(dtype),
        velocity=torch.randn(points, 2, generator=rng).to(dtype),
    )


def adam(task: Task) -> tuple[Tensor, Tensor, torch.optim.Optimizer]:
    """Copies of params and theta to train, and the optimizer of torch for them."""
    params, theta = task.params.clone().requires_grad_(), task.theta.clone().requires_grad_()
    on_gpu = params.is_cuda
    options: dict[str, Any] = {"fused": True, "capturable": True} if on_gpu else {}
    return params, theta, torch.optim.Adam([params, theta], lr=5e-4, **options)


def network_of(
    params: Tensor, widths: list[int], activation: Callable[[Tensor], Tensor] = silu
) -> Network:
    """The network of these parameters, points [B, 3] -> outputs [B, O]."""

    def network(x: Tensor) -> Tensor:
        start = 0
        for layer, (n_in, n_out) in enumerate(pairwise(widths)):
            W = params[start : start + n_out * n_in].view(n_out, n_in)
            b = params[start + n_out * n_in : start + n_out * (n_in + 1)]
            start += n_out * (n_in + 1)
            x = torch.nn.functional.linear(activation(x) if layer else x, W, b)
        return x

    return network


# ---------------------------------------------------------------- fused


def fused_step(task: Task, precision: str = "fp32", update: bool = True) -> Callable[[], Tensor]:
    """granpinn: the loss [] (or [E]) and its gradient from one op; without `update` no Adam."""
    from bench.own_adam import OwnAdam
    from granpinn.kernels import ops

    params, theta = task.params.clone(), task.theta.clone()
    optimizer = OwnAdam(params, theta)
    new = task.points.new_tensor
    spec = replace(task.spec, input_shift=new([0.0] * 3), input_scale=new([1.0] * 3))
    arguments = (task.batch, new([1.0] * 5), spec, new(PHYSICS), DEFAULT.name)

    def step() -> Tensor:
        loss, _, *gradients = ops.residual_loss(params, theta, *arguments, precision=precision)
        if update:
            optimizer.step(loss, *gradients)
        return loss

    return step


# ---------------------------------------------------------------- eager


def _gradient(f: Tensor, points: Tensor) -> tuple[Tensor, ...]:
    (g,) = torch.autograd.grad(f, points, torch.ones_like(f), create_graph=True)
    return g.unbind(1)


def nested_loss(task: Task, params: Tensor, theta: Tensor, points: Tensor) -> Tensor:
    """The loss by nested torch.autograd.grad at `points`, which require gradients."""
    z = network_of(params, task.widths)(points)
    u, v, p = _fields(z)
    first = [_gradient(f, points) for f in (u, v, p)]
    stress = _stress(task.form, z, p, first, theta)
    xx, xy, yy = (_gradient(tau, points) for tau in stress)
    return _loss(task, z, first, (xx[0] + xy[1], xy[0] + yy[1]), theta)


def eager_step(task: Task) -> Callable[[], Tensor]:
    """Nested torch.autograd.grad, as PINNs are usually written."""
    params, theta, optimizer = adam(task)
    points = task.points.clone().requires_grad_()

    def step() -> Tensor:
        optimizer.zero_grad()
        loss = nested_loss(task, params, theta, points)
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        return loss.detach()

    return step


# ---------------------------------------------------------------- the equations, once


def _fields(z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    p = P * z[:, 2] if z.shape[1] == 3 else -P * logsigmoid(-z[:, 2])
    return U * z[:, 0], U * z[:, 1], p


def _stress(form: str, z: Tensor, p: Tensor, first: list[Any], theta: Tensor) -> tuple[Tensor, ...]:
    """(tau_xx, tau_xy, tau_yy) from the outputs and (u, v)'s first derivatives."""
    if form == "mixed":
        return p * z[:, 3], p * z[:, 4], -p * z[:, 3]
    (u_x, u_y), (v_x, v_y) = (derivatives[:2] for derivatives in first[:2])
    shear = u_y + v_x
    gamma_dot = torch.sqrt(2 * u_x**2 + 2 * v_y**2 + shear**2 + SMOOTHING)
    eta = viscosity(gamma_dot, p, theta, D, ETA_MIN, ETA_MAX, P_FLOOR)
    return 2 * eta * u_x, eta * shear, 2 * eta * v_y


def _loss(
    task: Task, z: Tensor, first: list[Any], divergence: tuple[Tensor, Tensor], theta: Tensor
) -> Tensor:
    u, v, p = _fields(z)
    (u_x, u_y, u_t), (v_x, v_y, v_t), (p_x, p_y, _) = first
    squares = [
        u - task.velocity[:, 0],
        v - task.velocity[:, 1],
        u_t + u * u_x + v * u_y + p_x - divergence[0] - G_X,
        v_t + u * v_x + v * v_y + p_y - divergence[1] - G_Y,
        u_x + v_y,
    ]
    if task.form == "mixed":
        two_D_1, two_D_2 = u_x - v_y, u_y + v_x
        gamma_dot = torch.sqrt(two_D_1**2 + two_D_2**2 + SMOOTHING)
        mu = friction("mu_of_i", inertial_number(gamma_dot, p, D, P_FLOOR), theta)
        squares += [gamma_dot * z[:, 3] / mu - two_D_1, gamma_dot * z[:, 4] / mu - two_D_2]
    return torch.stack([(e**2).mean() for e in squares]).sum() / 2


STEPS: dict[str, Callable[[Task], Callable[[], Tensor]]] = {
    "fused": fused_step,
    "eager autograd": eager_step,
}
