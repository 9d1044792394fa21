"""Another equation on the fused jets: the viscosity of a fluid from its velocity.

The incompressible Navier-Stokes equations in two dimensions,

    u_t + u u_x + v u_y + p_x = nu (u_xx + u_yy),
    v_t + u v_x + v v_y + p_y = nu (v_xx + v_yy),      u_x + v_y = 0,

are solved by the vortices of Taylor and Green (Proc. R. Soc. A 158, 1937)

    u = sin x cos y exp(-2 nu t),   v = -cos x sin y exp(-2 nu t).

A network is fitted to velocities with noise, and nu and the pressure are identified with it.
`--compare` measures one step with the fused jets and with nested differentiation.

    python examples/navier_stokes.py --steps 2000
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.kernels import ops
from granpinn.kernels.network import drawn_parameters, views

NU = 0.05  # of the data
NOISE = 0.01
SIDE, END = math.pi, 4.0  # the box [0, SIDE]^2, and the last time

# The network (x, y, t) -> (u, v, p); inputs are mapped to [-1, 1], xi = (x - shift) * scale.
WIDTHS = [3, 64, 64, 64, 3]
SHIFT, SCALE = [SIDE / 2, SIDE / 2, END / 2], [2 / SIDE, 2 / SIDE, 2 / END]


class Jet(NamedTuple):
    """The outputs and their derivatives, [N, 3] each."""

    value: Tensor
    x: Tensor
    y: Tensor
    t: Tensor
    xx: Tensor
    xy: Tensor
    yy: Tensor


Jets = Callable[[Tensor, Tensor], Jet]


def network(seed: int = 0) -> Tensor:
    """All parameters of the network in one vector [P]."""
    return drawn_parameters(WIDTHS, seed).float().requires_grad_()


def points(count: int, draw: torch.Generator) -> Tensor:
    """Random points (x, y, t) of the box [count, 3]."""
    return torch.rand(count, 3, generator=draw) * torch.tensor([SIDE, SIDE, END])


def velocity(where: Tensor) -> Tensor:
    """The true (u, v) at points [N, 3]: [N, 2]."""
    x, y, t = where.unbind(1)
    decay = torch.exp(-2 * NU * t)
    return torch.stack([x.sin() * y.cos() * decay, -x.cos() * y.sin() * decay], 1)


def fused(params: Tensor, where: Tensor) -> Jet:
    """The derivatives by the fused kernels."""
    return Jet(*ops.network_jet(where, params, WIDTHS, SHIFT, SCALE, 2).unbind(0))


def nested(params: Tensor, where: Tensor) -> Jet:
    """The same by automatic differentiation, once more for each second derivative."""
    where = where.detach().requires_grad_()
    xi = (where - where.new_tensor(SHIFT)) * where.new_tensor(SCALE)
    layers = views(params, WIDTHS)
    for k, (W, b) in enumerate(layers):
        xi = xi @ W.T + b
        xi = torch.nn.functional.silu(xi) if k < len(layers) - 1 else xi

    def gradient(f: Tensor) -> Tensor:
        return torch.autograd.grad(f.sum(), where, create_graph=True)[0]

    first = [gradient(f) for f in xi.unbind(1)]  # [N, 3] of each output
    x, y, t = (torch.stack([g[:, i] for g in first], 1) for i in range(3))
    by_x = [gradient(f) for f in x.unbind(1)]
    by_y = [gradient(f) for f in y.unbind(1)]
    second = (by_x, 0), (by_x, 1), (by_y, 1)
    return Jet(xi, x, y, t, *(torch.stack([g[:, i] for g in of], 1) for of, i in second))


def residuals(jet: Jet, nu: Tensor) -> Tensor:
    """The three equations at N points: [N, 3]."""
    u, v, _ = jet.value.unbind(1)
    momentum = jet.t + u[:, None] * jet.x + v[:, None] * jet.y - nu * (jet.xx + jet.yy)
    e_u, e_v = momentum[:, 0] + jet.x[:, 2], momentum[:, 1] + jet.y[:, 2]
    return torch.stack([e_u, e_v, jet.x[:, 0] + jet.y[:, 1]], 1)


def loss(params: Tensor, log_nu: Tensor, where: Tensor, data: Tensor, jets: Jets) -> Tensor:
    """Mean squares of the misfit in units of the noise, and of the equations."""
    jet = jets(params, where)
    misfit = (jet.value[:, :2] - data) / NOISE
    return 1e-2 * misfit.square().mean() + residuals(jet, log_nu.exp()).square().mean()


def train(steps: int, jets: Jets = fused, count: int = 1024) -> tuple[Tensor, list[float]]:
    """The trained parameters, and nu after every step."""
    draw = torch.Generator().manual_seed(0)
    params, log_nu = network(), torch.tensor(math.log(0.5)).requires_grad_()
    adam = torch.optim.Adam([{"params": [params]}, {"params": [log_nu], "lr": 2e-2}], lr=4e-3)
    decay = torch.optim.lr_scheduler.LinearLR(adam, 1.0, 0.01, steps)
    found = []
    for _ in range(steps):
        where = points(count, draw)
        data = velocity(where) + NOISE * torch.randn(count, 2, generator=draw)
        adam.zero_grad()
        loss(params, log_nu, where, data, jets).backward()
        adam.step()
        decay.step()
        found.append(float(log_nu.detach().exp()))
    return params, found


def seconds(jets: Jets, steps: int = 50) -> float:
    """CPU seconds of one step, without the first ones."""
    train(5, jets)
    begin = time.process_time()
    train(steps, jets)
    return (time.process_time() - begin) / steps


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--compare", action="store_true", help="measure the time of a step")
    args = parser.parse_args(argv)
    if args.compare:
        own, plain = seconds(fused), seconds(nested)
        print(f"fused {1e3 * own:.1f}, nested {1e3 * plain:.1f} ms of CPU time a step")
        return
    params, found = train(args.steps)
    where = points(2000, torch.Generator().manual_seed(1))
    error = (fused(params, where).value[:, :2] - velocity(where)).square().mean().sqrt()
    print(f"nu = {found[-1]:.4f}, the data have {NU}; rms error of the velocity {error:.1e}")


if __name__ == "__main__":
    main()
