"""One optimization step, loss + gradients + Adam update, as granpinn and as a PINN user write it.

All train the paper's network, 3x250 swish, on the same points with the same loss: that of
`granpinn.reference.loss` with unit weights and no surface points. On a GPU no step waits for the
device, so that it can be captured: granpinn's Adam is its own, the rivals' is torch's fused one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor

from granpinn.kernels.network import NetworkSpec
from granpinn.physics.laws import DEFAULT
from granpinn.physics.terms import LossPoints
from granpinn.reference.loss import loss_terms

HIDDEN = [250, 250, 250]
D, G_X, G_Y, ETA_MIN, ETA_MAX, U, P, P_FLOOR = [0.02, 0.0, -1.0, 0.0, 1e4, 1.0, 1.0, 1e-4]
PHYSICS = [D, G_X, G_Y, ETA_MIN, ETA_MAX, U, P, P_FLOOR, math.inf, 0.0, 1.0, 1.0]
THETA = (0.4, 0.64, 0.3)


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


def on_device(task: Task) -> NetworkSpec:
    """The network with its shift and scale as tensors: a step in a graph copies nothing."""
    new = task.points.new_tensor
    return replace(task.spec, input_shift=new([0.0] * 3), input_scale=new([1.0] * 3))


def fused_step(task: Task, precision: str = "fp32", update: bool = True) -> Callable[[], Tensor]:
    """granpinn: the loss [] (or [E]) and its gradient from one op; without `update` no Adam."""
    from bench.own_adam import OwnAdam
    from granpinn.kernels import ops

    params, theta = task.params.clone(), task.theta.clone()
    optimizer = OwnAdam(params, theta)
    new = task.points.new_tensor
    arguments = (task.batch, new([1.0] * 5), on_device(task), new(PHYSICS), DEFAULT.name)

    def step() -> Tensor:
        loss, _, *gradients = ops.residual_loss(params, theta, *arguments, precision=precision)
        if update:
            optimizer.step(loss, *gradients)
        return loss

    return step


def eager_step(task: Task) -> Callable[[], Tensor]:
    """Nested torch.autograd.grad, as PINNs are usually written: the loss of granpinn.reference."""
    params, theta, optimizer = adam(task)
    batch, spec = task.batch, on_device(task)

    def step() -> Tensor:
        optimizer.zero_grad()
        loss = loss_terms(params, theta, batch, spec, PHYSICS).sum()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        return loss.detach()

    return step


STEPS: dict[str, Callable[[Task], Callable[[], Tensor]]] = {
    "fused": fused_step,
    "eager autograd": eager_step,
}
