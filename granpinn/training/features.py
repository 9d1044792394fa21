"""The outputs of the last hidden layer of a network: the inputs of its last layer."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from granpinn.kernels import ops
from granpinn.kernels.network import NetworkSpec, layer_offsets, views


class Features:
    """h(x, y, t) of a trained network; the last feature is 1, for the bias.

    Args:
        params: of the network [P], on the device to work on.
        window: side of the squares over which each vector is a mean, 0 for values at points.
    """

    def __init__(self, spec: NetworkSpec, params: Tensor, window: float = 0.0) -> None:
        n, last = spec.widths[-2], layer_offsets(spec.widths)[-1]
        identity = torch.eye(n, dtype=torch.float64, device=params.device).flatten()
        self._window = window
        self._params = torch.cat([params[:last].double(), identity, identity.new_zeros(n)])
        self._network = ([*spec.widths[:-1], n], list(spec.input_shift), list(spec.input_scale))

    def jet(self, points: Tensor, order: int = 1) -> Tensor:
        """h and, for order 1, its derivatives by x, y, t: [4 or 1, N, F], float64."""
        h = ops.network_jet(points.double(), self._params, *self._network, order)
        one = torch.zeros_like(h[:, :, :1])
        one[0] = 1
        return torch.cat([h, one], 2)

    def of_vectors(self, points: Tensor) -> Tensor:
        """h [N, F] as vectors measure it: its mean over the window around each point.

        The mean of four points at +-window/sqrt(12) in x and y, to second order h + w^2/24 (h_xx +
        h_yy), is that over the square.
        """
        if self._window == 0:
            return self.jet(points, 0)[0]
        corners = _corners(points, self._window / math.sqrt(12))
        return torch.stack([self.jet(points + corner, 0)[0] for corner in corners]).mean(0)

    def with_means(self, points: Tensor, length: float) -> Tensor:
        """The jet of order 1 and the means of its derivatives by x and y: [6, N, F].

        The means are over four points at +-length/sqrt(2) in x and y. To second order in the
        length they are the means 1-2-1 over three cells of that size.
        """
        if length == 0:
            here = self.jet(points)
            return torch.cat([here, here[1:3]])
        corners = _corners(points, length / math.sqrt(2))
        around = torch.stack([self.jet(points + corner)[1:3] for corner in corners])
        return torch.cat([self.jet(points), around.mean(0)])


def _corners(points: Tensor, a: float) -> Tensor:
    """(+-a, +-a, 0) [4, 3]."""
    return points.new_tensor([[i * a, j * a, 0] for i in (1, -1) for j in (1, -1)])


def coefficients(spec: NetworkSpec, params: Tensor) -> Tensor:
    """C [5, F] float64 of the last layer of params [P]."""
    W, b = views(params.double(), spec.widths)[-1]
    return torch.cat([W, b[:, None]], 1)


def with_coefficients(spec: NetworkSpec, params: Tensor, C: Tensor) -> Tensor:
    """params [P] with another last layer."""
    changed = params.clone()
    W, b = views(changed, spec.widths)[-1]
    W.copy_(C[:, :-1])
    b.copy_(C[:, -1])
    return changed
