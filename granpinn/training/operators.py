"""The operators that know the friction law: compiled ones, or the same ones in torch.

A compiled law has kernels (granpinn/kernels). For a law of a user, the kernels give the network and
its derivatives, and the equations of the mixed form and their gradients come from torch. The
arguments and results are the same, so there is one training for both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from granpinn import reference
from granpinn.kernels import ops, step_ops
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.constants import Physics
from granpinn.physics.laws import LAWS, FrictionLaw
from granpinn.physics.terms import NAMES, RESIDUALS, LossPoints
from granpinn.training.equations import residuals

_ops = torch.ops.granpinn

Operator = Callable[..., Any]
Losses = tuple[Tensor, Tensor, Tensor, Tensor]


class Operators(NamedTuple):
    """Functions with the arguments of granpinn.kernels.ops, and batch_loss of its step_ops.

    Attributes:
        captured: whether a CUDA graph can hold them.
    """

    batch_loss: Operator
    residual_loss: Operator
    viscosity: Operator
    pointwise_residuals: Operator
    captured: bool


def operators_of(laws: Sequence[FrictionLaw]) -> Operators:
    """The operators for the laws of the members of one run.

    Raises:
        ValueError: a law in torch beside another law.
    """
    if all(law.compiled for law in laws):
        return COMPILED
    if len({law.name for law in laws}) > 1:
        raise ValueError("members of one run must all have the same law if it is one in torch")
    return IN_TORCH


def batch_loss(
    params: Tensor,
    theta: Tensor,
    draw: step_ops.Draw,
    spec: NetworkSpec,
    physics: Tensor,
    law: str,
    *,
    precision: str,
    equations: bool,
) -> Losses:
    """As `granpinn.kernels.step_ops.batch_loss`; `precision` has no effect."""
    *control, (*data, source), weights, interior, surface = draw
    *drawn, term_weights, force = _ops.draw_batch(
        *control, *data, weights, interior, surface, source
    )
    batch = LossPoints._make([*drawn, None if source is None else force])
    found = []
    for e in range(len(params)):
        shift, scale = (torch.as_tensor(x)[e] for x in (spec.input_shift, spec.input_scale))
        own = replace(spec, input_shift=shift, input_scale=scale)
        at = (params[e], theta[e], batch.member(e), term_weights[e], own, physics[e], law)
        found.append(residual_loss(*at, equations=equations))
    loss, terms, grad_params, grad_theta = (torch.stack(part) for part in zip(*found, strict=True))
    return loss, terms, grad_params, grad_theta


def residual_loss(
    params: Tensor,
    theta: Tensor,
    batch: LossPoints,
    term_weights: Tensor,
    spec: NetworkSpec,
    physics: ops.Constants,
    law: str,
    *,
    equations: bool = True,
) -> Losses:
    """Loss, terms and gradients of one member of the mixed form, in torch.

    Everything as in `granpinn.kernels.ops.residual_loss`.
    """
    shift, scale, numbers = (
        torch.as_tensor(values, dtype=params.dtype).tolist()
        for values in (spec.input_shift, spec.input_scale, physics)
    )
    network, constants = (spec.widths, shift, scale), Physics(*numbers)
    points, velocity, point_weights, surface_points, surface_pressure, source = batch
    with torch.enable_grad():
        leaves = params.detach().requires_grad_(), theta.detach().requires_grad_()
        jet = ops.network_jet(points, leaves[0], *network, int(equations))
        misfit = jet.new_tensor(constants.velocity_scales) * jet[0, :, :2] - velocity
        at_surface = ops.network_value(surface_points, leaves[0], *network)[:, 2]
        p = constants.pressure_scale * torch.nn.functional.softplus(at_surface)
        terms = dict.fromkeys(NAMES, misfit.new_zeros(()))
        terms["velocity"] = _half_mean(point_weights[:, 0], misfit)
        terms["surface"] = _half_mean(torch.ones_like(p), (p - surface_pressure)[:, None])
        if equations:
            # The means of the strain rate are those at the point itself.
            z = torch.cat([jet, jet[1:3]])
            at_points = leaves[1].expand(len(points), -1)
            e, _ = residuals(z, at_points, constants, LAWS[law], source)
            for name in dict.fromkeys(RESIDUALS[spec.form]):
                columns = [k for k, term in enumerate(RESIDUALS[spec.form]) if term == name]
                terms[name] = _half_mean(point_weights[:, 1], e[:, columns])
        found = torch.stack(list(terms.values()))
        loss = (term_weights * found).sum()
        by_params, by_theta = torch.autograd.grad(loss, leaves, materialize_grads=True)
    return loss.detach(), found.detach(), by_params, by_theta


def pointwise_residuals(*case: Any) -> Tensor:
    """As `granpinn.kernels.ops.pointwise_residuals`, by nested automatic differentiation."""
    with torch.enable_grad():
        return reference.pointwise_residuals(*case).detach()


def _half_mean(weights: Tensor, vectors: Tensor) -> Tensor:
    """1/(2N) sum of weights [N] times |vectors [N, .]|^2."""
    return (weights * vectors.square().sum(1)).sum() / (2 * max(len(vectors), 1))


COMPILED = Operators(
    step_ops.batch_loss, ops.residual_loss, ops.viscosity, ops.pointwise_residuals, captured=True
)
IN_TORCH = Operators(
    batch_loss, residual_loss, reference.viscosity, pointwise_residuals, captured=False
)
