"""The network of equation (8) and its derivatives, by nested automatic differentiation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import torch
from torch import Tensor

RawNetwork = Callable[[Tensor], Tensor]  # points [N, 3] -> raw outputs z [N, K]


def member(tensor: Tensor, e: int, rank: int) -> Tensor:
    """Member e of an ensemble: a slice, or all of `tensor` if it has only its own `rank` axes."""
    return tensor[e] if tensor.ndim > rank else tensor


def network(
    params: Tensor,
    widths: Sequence[int],
    input_shift: Sequence[float] | Tensor,
    input_scale: Sequence[float] | Tensor,
) -> RawNetwork:
    """Fully connected network with swish; params holds W [out, in] and b [out] of each layer."""
    shift, scale = (
        torch.as_tensor(x, dtype=params.dtype, device=params.device)
        for x in (input_shift, input_scale)
    )

    def z(points: Tensor) -> Tensor:
        a = (points - shift) * scale
        start = 0
        for layer, (n_in, n_out) in enumerate(pairwise(widths)):
            W = params[start : start + n_out * n_in].view(n_out, n_in)
            b = params[start + n_out * n_in : start + n_out * (n_in + 1)]
            start += n_out * (n_in + 1)
            if layer > 0:
                a = a * torch.sigmoid(a)
            a = a @ W.T + b
        return a

    return z


def gradient(f: Tensor, points: Tensor) -> Tensor:
    """(f_x, f_y, f_t) [N, 3] of f [N], where f[i] depends on points[i] alone."""
    if not f.requires_grad:
        return torch.zeros_like(points)
    return torch.autograd.grad(f.sum(), points, create_graph=True, materialize_grads=True)[0]


def network_value(
    points: Tensor,
    params: Tensor,
    widths: Sequence[int],
    input_shift: Sequence[float],
    input_scale: Sequence[float],
) -> Tensor:
    """Raw outputs z [N, K] (or [E, N, K])."""
    if params.ndim == 2:
        return torch.stack(
            [
                network_value(member(points, e, 2), w, widths, input_shift, input_scale)
                for e, w in enumerate(params)
            ]
        )
    return network(params, widths, input_shift, input_scale)(points)


def network_jet(
    points: Tensor,
    params: Tensor,
    widths: Sequence[int],
    input_shift: Sequence[float],
    input_scale: Sequence[float],
    order: int,
) -> Tensor:
    """Raw outputs and their derivatives [C, N, K] (or [E, C, N, K]).

    order 1: C = 4, (z, z_x, z_y, z_t); order 2: C = 7, followed by (z_xx, z_xy, z_yy).
    """
    if params.ndim == 2:
        return torch.stack(
            [
                network_jet(member(points, e, 2), w, widths, input_shift, input_scale, order)
                for e, w in enumerate(params)
            ]
        )
    points = points.detach().requires_grad_()
    z = network(params, widths, input_shift, input_scale)(points)
    per_output = []
    for k in range(widths[-1]):
        z_k = z[:, k]
        d1 = gradient(z_k, points)
        channels = [z_k, *d1.unbind(1)]
        if order == 2:
            d_x, d_y = gradient(d1[:, 0], points), gradient(d1[:, 1], points)
            channels += [d_x[:, 0], d_x[:, 1], d_y[:, 1]]
        per_output.append(torch.stack(channels))
    return torch.stack(per_output, dim=-1)
