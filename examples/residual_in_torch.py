"""A residual of your own in plain torch, on the fused jets of granpinn.

`granpinn.SwishNetwork` gives a network with its first and second derivatives, and is differentiable
in the parameters. So any equation of second order can be tried without a kernel of its own. Here
the Burgers equation

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

from granpinn import SwishNetwork

NU = 0.02


def network(seed: int = 0) -> SwishNetwork:
    """u(x, t); it does not depend on y."""
    return SwishNetwork(1, (64, 64, 64), lower=(-1, 0, 0), upper=(1, 0, 1), seed=seed)


def points(x: Tensor, t: Tensor) -> Tensor:
    """Points [N, 3] = (x, y = 0, t)."""
    return torch.stack([x, torch.zeros_like(x), t], 1)


def residual(net: SwishNetwork, where: Tensor) -> Tensor:
    """u_t + u u_x - nu u_xx at points [N, 3]: [N]."""
    u = net.jet(where)
    return (u.t + u.value * u.x - NU * u.xx)[:, 0]


def loss(net: SwishNetwork, draw: torch.Generator, count: int = 2048) -> Tensor:
    """Mean squares of the equation inside, and of u at the start and on the sides."""
    x, t = 2 * torch.rand(count, generator=draw) - 1, torch.rand(count, generator=draw)
    start, sides = net(points(x, 0 * t))[:, 0], net(points(x.sign(), t))[:, 0]
    misfit = (start + torch.sin(math.pi * x)).square().mean() + sides.square().mean()
    return residual(net, points(x, t)).square().mean() + 10 * misfit


def train(steps: int, seed: int = 0) -> tuple[SwishNetwork, list[float]]:
    """The trained network, and the loss of every step."""
    draw = torch.Generator().manual_seed(seed)
    net = network(seed)
    adam = torch.optim.Adam(net.parameters(), lr=2e-3)
    decay = torch.optim.lr_scheduler.LinearLR(adam, 1.0, 0.01, steps)
    losses = []
    for _ in range(steps):
        adam.zero_grad()
        value = loss(net, draw)
        value.backward()
        adam.step()
        decay.step()
        losses.append(float(value.detach()))
    return net, losses


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--figure", help="file for a figure of u(x, t)")
    args = parser.parse_args()
    net, losses = train(args.steps)
    x = torch.linspace(-1, 1, 9)
    u = net(points(x, torch.ones_like(x)))[:, 0]
    print(f"loss {losses[0]:.3g} -> {losses[-1]:.3g}")
    print("u(x, 1) at x = -1 .. 1:", " ".join(f"{value:.3f}" for value in u.tolist()))
    if args.figure is not None:
        draw(net, args.figure)


def draw(net: SwishNetwork, file: str) -> None:
    """u(x, t) as a map, and over x at five times."""
    x, t = torch.linspace(-1, 1, 201), torch.linspace(0, 1, 101)
    with torch.no_grad():
        u = net(points(x.repeat(101), t.repeat_interleave(201)))[:, 0].reshape(101, 201)
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
