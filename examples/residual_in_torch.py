"""A residual of your own in plain torch, on the fused jets of granpinn.

`granpinn.kernels.ops.network_jet` gives a network with its first and second derivatives by x, y, t,
and is differentiable in the parameters. So any equation of second order can be tried without a
kernel of its own. Here the Burgers equation

    u_t + u u_x = nu u_xx,   nu = 0.02,

is learnt on x in [-1, 1], t in [0, 1] from its start u = -sin(pi x) and its sides u = 0.

    python examples/residual_in_torch.py --steps 3000
"""

from __future__ import annotations

import argparse
import math

import torch
from torch import Tensor

from granpinn.kernels import ops
from granpinn.kernels.network import NetworkSpec, initial_parameters

NU = 0.02
# Three outputs, of which the first is u; the map takes t in [0, 1] to [-1, 1].
SPEC = NetworkSpec((3, 64, 64, 64, 3), (0.0, 0.0, 0.5), (1.0, 1.0, 2.0), "strong")
NETWORK = (list(SPEC.widths), list(SPEC.input_shift), list(SPEC.input_scale))
VALUE, X, _, T, XX = range(5)  # channels of a jet of order 2


def points(x: Tensor, t: Tensor) -> Tensor:
    """Points [N, 3] = (x, y = 0, t)."""
    return torch.stack([x, torch.zeros_like(x), t], 1)


def residual(params: Tensor, where: Tensor) -> Tensor:
    """u_t + u u_x - nu u_xx at points [N, 3]: [N]."""
    u = ops.network_jet(where, params, *NETWORK, 2)[..., 0]
    return u[T] + u[VALUE] * u[X] - NU * u[XX]


def loss(params: Tensor, draw: torch.Generator, count: int = 2048) -> Tensor:
    """Mean squares of the equation inside, and of u at the start and on the sides."""
    x, t = 2 * torch.rand(count, generator=draw) - 1, torch.rand(count, generator=draw)
    side = x.sign()
    start = ops.network_value(points(x, 0 * t), params, *NETWORK)[:, 0]
    sides = ops.network_value(points(side, t), params, *NETWORK)[:, 0]
    inside = residual(params, points(x, t))
    misfit = (start + torch.sin(math.pi * x)).square().mean() + sides.square().mean()
    return inside.square().mean() + 10 * misfit


def train(steps: int, seed: int = 0) -> tuple[Tensor, list[float]]:
    """The trained parameters [P], and the loss of every step."""
    draw = torch.Generator().manual_seed(seed)
    params = initial_parameters(SPEC, seed).float().requires_grad_()
    adam = torch.optim.Adam([params], lr=2e-3)
    decay = torch.optim.lr_scheduler.LinearLR(adam, 1.0, 0.01, steps)
    losses = []
    for _ in range(steps):
        adam.zero_grad()
        value = loss(params, draw)
        value.backward()
        adam.step()
        decay.step()
        losses.append(float(value.detach()))
    return params.detach(), losses


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=3000)
    params, losses = train(parser.parse_args().steps)
    x = torch.linspace(-1, 1, 9)
    u = ops.network_value(points(x, torch.ones_like(x)), params, *NETWORK)[:, 0]
    print(f"loss {losses[0]:.3g} -> {losses[-1]:.3g}")
    print("u(x, 1) at x = -1 .. 1:", " ".join(f"{value:.3f}" for value in u.tolist()))


if __name__ == "__main__":
    main()
