"""A swish network with its derivatives by the fused kernels, for equations of your own.

docs/guides/other-equations.md is the guide; examples/navier_stokes.py uses it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.declared import checked
from granpinn.kernels import ops
from granpinn.kernels.network import drawn_parameters

INPUTS = 3


class Jet(NamedTuple):
    """The outputs and their derivatives by x, y and t, [N, K] each; None where not asked for."""

    value: Tensor
    x: Tensor | None = None
    y: Tensor | None = None
    t: Tensor | None = None
    xx: Tensor | None = None
    xy: Tensor | None = None
    yy: Tensor | None = None


class SwishNetwork(torch.nn.Module):
    """A fully connected network of (x, y, t) with swish, whose derivatives are one fused kernel.

        net = granpinn.SwishNetwork(1, hidden=(64, 64), lower=(-1, 0, 0), upper=(1, 0, 1))
        u = net.jet(points)                             # u.value, u.x, u.t, u.xx, ... [N, 1]
        loss = (u.t + u.value * u.x - nu * u.xx).square().mean()
        loss.backward()                                 # gradient in net.params

    It works on CPUs and, after `.to("cuda")`, on GPUs; in float32 and float64; with any optimiser
    of torch. Gradients are of first order and in the parameters alone: points are constants. Second
    derivatives exist by x and y; a coordinate with a second derivative in your equation must be one
    of these.

    Args:
        outputs: number K of outputs.
        hidden: widths of the hidden layers.
        lower, upper: box of the points, (x, y, t); inputs are mapped to [-1, 1] first. Where both
            are equal, the network does not depend on this coordinate.
        seed: of the first parameters, which are the same on every machine.

    Attributes:
        params: all parameters in one vector [P], as granpinn.kernels.network describes.

    Raises:
        ValueError: no network has such widths, or the box is none.
    """

    params: torch.nn.Parameter

    @checked
    def __init__(
        self,
        outputs: int,
        hidden: Sequence[int] = (64, 64, 64),
        lower: Sequence[float] = (-1.0, -1.0, -1.0),
        upper: Sequence[float] = (1.0, 1.0, 1.0),
        seed: int = 0,
    ) -> None:
        super().__init__()
        box = [*zip(lower, upper, strict=False)]
        ordered = all(math.isfinite(high - low) and low <= high for low, high in box)
        if not len(lower) == len(upper) == len(box) == INPUTS or not ordered:
            raise ValueError(
                "lower and upper must be three finite numbers each, x, y and t, with lower <= "
                f"upper, got {lower} and {upper}"
            )
        self.widths = [INPUTS, *hidden, outputs]
        if min(self.widths) < 1:
            raise ValueError(f"outputs and hidden widths must be positive, got {self.widths[1:]}")
        self.input_shift = [(low + high) / 2 for low, high in box]
        self.input_scale = [2 / (high - low) if high > low else 0.0 for low, high in box]
        self.params = torch.nn.Parameter(drawn_parameters(self.widths, seed).float())

    def forward(self, points: Tensor) -> Tensor:
        """The outputs [N, K] at points [N, 3] = (x, y, t)."""
        return self.jet(points, 0).value

    @checked
    def jet(self, points: Tensor, order: int = 2) -> Jet:
        """The outputs with their derivatives at points [N, 3] = (x, y, t).

        Args:
            order: 0: value; 1: and x, y, t; 2: and xx, xy, yy.

        Raises:
            BadInput: `points` or `order` have another type.
            ValueError, TypeError: `points` have another shape, type or device than the kernels
                take, or require a gradient.
        """
        network = self.widths, self.input_shift, self.input_scale
        return Jet(*ops.network_jet(points, self.params, *network, order).unbind(0))
