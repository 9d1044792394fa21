"""The network as one flat vector of parameters.

Fully connected, swish between layers, widths [3, h_1, ..., h_L, K]. For each layer the vector holds
W [out, in] row by row, then b [out]. Inputs (x, y, t) are mapped first, xi = (x - shift) * scale.
K = 3 for the strong form (u, v, p), K = 5 for the mixed form (u, v, p, s_1, s_2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor

OUTPUTS = {"strong": 3, "mixed": 5}


@dataclass(frozen=True)
class NetworkSpec:
    """The layers, input map and form of a network: everything except its parameters.

    Members of an ensemble that have their own input maps have them as tensors [E, 3].
    """

    widths: tuple[int, ...]
    input_shift: tuple[float, ...] | Tensor
    input_scale: tuple[float, ...] | Tensor
    form: str

    def __post_init__(self) -> None:
        expected = OUTPUTS[self.form]
        if len(self.widths) < 2 or self.widths[0] != 3 or self.widths[-1] != expected:
            raise ValueError(
                f"widths must be 3, hidden widths, {expected} for the {self.form} form, "
                f"got {self.widths}"
            )

    @property
    def n_params(self) -> int:
        return n_params(self.widths)


def n_params(widths: Sequence[int]) -> int:
    """Length P of the flat parameter vector."""
    return sum(n_out * (n_in + 1) for n_in, n_out in pairwise(widths))


def layer_offsets(widths: Sequence[int]) -> list[int]:
    """Where W of each layer begins in the flat parameter vector."""
    return [n_params(widths[: layer + 1]) for layer in range(len(widths) - 1)]


def views(params: Tensor, widths: Sequence[int]) -> list[tuple[Tensor, Tensor]]:
    """(W [out, in], b [out]) of every layer, sharing memory with params [P]."""
    if params.shape != (n_params(widths),):
        raise ValueError(
            f"params must be [{n_params(widths)}] for widths {list(widths)}, "
            f"got {list(params.shape)}"
        )
    layers = []
    start = 0
    for n_in, n_out in pairwise(widths):
        W = params[start : start + n_out * n_in].view(n_out, n_in)
        start += n_out * n_in
        layers.append((W, params[start : start + n_out]))
        start += n_out
    return layers


def initial_parameters(spec: NetworkSpec, seed: int, distribution: str = "wide") -> Tensor:
    """params [P] float64, a function of the arguments alone.

    As `drawn_parameters`; with "wide", outputs for pressure and stress are smaller than u and v.
    """
    params = drawn_parameters(spec.widths, seed, distribution)
    if distribution == "wide":
        W, _ = views(params, spec.widths)[-1]
        W[2:] *= 0.3
    return params


def drawn_parameters(widths: Sequence[int], seed: int, distribution: str = "wide") -> Tensor:
    """params [P] float64 for any widths, a function of the arguments alone.

    "glorot_uniform": variance 2 / (n_in + n_out), zero biases (Glorot & Bengio, AISTATS 2010).
    "wide": inputs in [-1, 1] are spread over the bend of swish, W ~ N(0, 1), b ~ U(-1, 1) in the
    first layer; gain 1.4 against the contraction of swish in the hidden ones; outputs of order 1.
    """
    generator = torch.Generator().manual_seed(seed)
    params = torch.zeros(n_params(widths), dtype=torch.float64)
    layers = views(params, widths)
    for i, (W, b) in enumerate(layers):
        n_out, n_in = W.shape
        if distribution == "glorot_uniform":
            bound = math.sqrt(6 / (n_in + n_out))
            W.uniform_(-bound, bound, generator=generator)
        elif i == 0:
            W.normal_(0, 1, generator=generator)
            b.uniform_(-1, 1, generator=generator)
        else:
            last = i == len(layers) - 1
            W.normal_(0, (1 if last else 1.4) / math.sqrt(n_in), generator=generator)
    return params
