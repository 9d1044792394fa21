"""A residual of your own in plain torch, on the fused jets of granpinn.

`granpinn.kernels.ops.network_jet` gives a network with its first and second derivatives, and is
differentiable in the parameters. So any equation of second order can be tried without a kernel of
its own. Here the Burgers equation

    u_t + u u_x = nu u_xx,   nu = 0.02,

is learnt on x in [-1, 1], t in [0, 1] from its start u = -sin(pi x) and its sides u = 0.

    python examples/residual_in_torch.py --steps 3000 --figure burgers.png
"""

from __future__ import annotations

import argparse
import math

import torch
from matplotlib import pyplot
from torch import Tensor

from granpinn.kernels import ops
from granpinn.kernels.network import drawn_parameters

NU = 0.02


# The network (x, y, t) -> u; inputs are mapped to [-1, 1], and u does not depend on y.
NETWORK = [3, 64, 64, 64, 1], [0.0, 0.0, 0.5], [1.0, 0.0, 2.0]  # widths, shift, scale


def network(seed: int = 0) -> Tensor:
    """All parameters of the network in one vector [P]."""
    return drawn_parameters(NETWORK[0], seed).float().requires_grad_()


def value(params: Tensor, where: Tensor) -> Tensor:
    """u at points [N, 3]: [N]."""
    return ops.network_value(where, params, *NETWORK)[:, 0]


def points(x: Tensor, t: Tensor) -> Tensor:
    """Points [N, 3] = (x, y = 0, t)."""
    return torch.stack([x, torch.zeros_like(x), t], 1)


def residual(params: Tensor, where: Tensor) -> Tensor:
    """u_t + u u_x - nu u_xx at points [N, 3]: [N]."""
    u, u_x, _, u_t, u_xx, _, _ = ops.network_jet(where, params, *NETWORK, 2).unbind(0)
    return (u_t + u * u_x - NU * u_xx)[:, 0]


def loss(params: Tensor, draw: torch.Generator, count: int = 2048) -> Tensor:
    """Mean squares of the equation inside, and of u at the start and on the sides."""
    x, t = 2 * torch.rand(count, generator=draw) - 1, torch.rand(count, generator=draw)
    start, sides = value(params, points(x, 0 * t)), value(params, points(x.sign(), t))
    misfit = (start + torch.sin(math.pi * x)).square().mean() + sides.square().mean()
    return residual(params, points(x, t)).square().mean() + 10 * misfit


def train(steps: int, seed: int = 0) -> tuple[Tensor, list[float]]:
    """The trained parameters, and the loss of every step."""
    draw = torch.Generator().manual_seed(seed)
    params = network(seed)
    adam = torch.optim.Adam([params], lr=2e-3)
    decay = torch.optim.lr_scheduler.LinearLR(adam, 1.0, 0.01, steps)
    losses = []
    for _ in range(steps):
        adam.zero_grad()
        found = loss(params, draw)
        found.backward()
        adam.step()
        decay.step()
        losses.append(float(found.detach()))
    return params, losses


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--figure", help="file for a figure of u(x, t)")
    args = parser.parse_args()
    params, losses = train(args.steps)
    x = torch.linspace(-1, 1, 9)
    u = value(params, points(x, torch.ones_like(x)))
    print(f"loss {losses[0]:.3g} -> {losses[-1]:.3g}")
    print("u(x, 1) at x = -1 .. 1:", " ".join(f"{number:.3f}" for number in u.tolist()))
    if args.figure is not None:
        draw(params, args.figure)


def draw(params: Tensor, file: str) -> None:
    """u(x, t) as a map, and over x at five times."""
    x, t = torch.linspace(-1, 1, 201), torch.linspace(0, 1, 101)
    with torch.no_grad():
        u = value(params, points(x.repeat(101), t.repeat_interleave(201))).reshape(101, 201)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
    image = left.pcolormesh(t, x, u.T, shading="nearest")
    left.set(xlabel="t", ylabel="x")
    figure.colorbar(image, label="u")
    for k in range(0, 101, 25):
        right.plot(x, u[k], label=f"t = {t[k]:.2f}")
    right.set(xlabel="x", ylabel="u")
    right.legend()
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    main()
