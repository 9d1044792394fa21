"""The operators of one optimization step of E members; csrc/step.h describes each.

A step copies nothing to the host. `counter` int64 [3] holds the number of the step, and `table`
[rows, 1 + E] float64 the schedule of the next steps (granpinn/training/schedule.py). `update`
and `descend` change tensors in place.

`draw_batch` returns the points of a batch and the weights of its terms, then the source there;
without a source the last one has no rows.

The operators raise ValueError or TypeError for wrong sizes, and if a tensor that they change shares
memory with another. `places` must lie within the points: a CPU raises ValueError. A GPU draws NaN
for a member with a wrong place, because a check would wait for the device; its loss is then NaN.

`orthogonalize` gives U V^T of matrices G = U S V^T [..., m, n], to about 30 %, by five steps of
Newton-Schulz (csrc/cpu/orthogonalize.h); `descend` subtracts it, times a learning rate, from
matrices of the parameters. With `precision` "fast" a GPU rounds the operands of products to half
precision if G is float32 with sides up to 128. The error of U V^T is then 0.2 % (Muon is published
in bfloat16, 2 %), and `descend` takes one launch. Sums and the iterate stay in float32. "fast"
changes nothing on a CPU, in float64 and for larger matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.kernels import registration  # noqa: F401  (loads the operators)
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.terms import LossPoints

VARIABLES = {"fixed": 0, "log": 1, "log_above": 2, "logistic": 3}
"""Codes of the unbounded variables q of a law (csrc/math/law_variables.h), for `update`."""


class Draw(NamedTuple):
    """What a step draws from, and how much: the arguments of `draw_batch`.

    Attributes:
        counter, table: the step and its schedule.
        seeds: of every member [E].
        places: first point, points, first surface point and surface points of every member [E, 4].
        data: the points of all members, one after another.
        term_weights: [E, 5].
        interior, surface: points of a batch.
    """

    counter: Tensor
    table: Tensor
    seeds: Tensor
    places: Tensor
    data: LossPoints
    term_weights: Tensor
    interior: int
    surface: int


def batch_loss(
    params: Tensor,
    theta: Tensor,
    draw: Draw,
    spec: NetworkSpec,
    physics: Tensor,
    law: str,
    *,
    precision: str,
    equations: bool,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """`granpinn.kernels.ops.residual_loss` of E members over the batch that `draw_batch` draws.

    The input map of `spec` and `physics` are tensors [E, ...]. On a GPU it also packs the weights.
    """
    *control, (*points, source), term_weights, interior, surface = draw
    drawn = (*control, *points, term_weights, interior, surface)
    form = spec.form if equations else "data"
    network = (spec.widths, spec.input_shift, spec.input_scale, physics, form)
    out: tuple[Tensor, Tensor, Tensor, Tensor] = torch.ops.granpinn.batch_loss(
        *drawn, params, theta, *network, law, precision, source
    )
    return out
