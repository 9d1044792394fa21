"""Loads the compiled operators and registers their shapes for tracing and their gradients.

Gradients are of first order. A second derivative raises an error: it would need further kernels.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from granpinn.kernels import builds
from granpinn.physics.terms import NAMES, RESIDUALS, LossPoints

builds.load()

CHANNELS = (1, 4, 7)  # of jets of order 0, 1, 2

_ops = torch.ops.granpinn


def _require(fits: bool, expected: str, got: object) -> None:
    """The check of csrc/ops for arguments on which a shape depends; ValueError."""
    if not fits:
        raise ValueError(f"{expected}, got {got!r}")


def _leading(params: Tensor) -> list[int]:
    return list(params.shape[:-1])


@torch.library.register_fake("granpinn::network_jet")
def _(points, params, widths, input_shift, input_scale, order):  # type: ignore[no-untyped-def]
    _require(0 <= order < len(CHANNELS), "order must be 0, 1 or 2", order)
    return params.new_empty([*_leading(params), CHANNELS[order], points.shape[-2], widths[-1]])


@torch.library.register_fake("granpinn::network_jet_backward")
def _(grad, points, params, widths, input_shift, input_scale, order):  # type: ignore[no-untyped-def]
    return torch.empty_like(params, memory_format=torch.contiguous_format)


@torch.library.register_fake("granpinn::residual_loss")
def _(params, theta, *inputs):  # type: ignore[no-untyped-def]
    lead = _leading(params)
    return (
        params.new_empty(lead),
        params.new_empty([*lead, len(NAMES)]),
        torch.empty_like(params, memory_format=torch.contiguous_format),
        params.new_empty([*lead, theta.shape[-1]]),
    )


@torch.library.register_fake("granpinn::viscosity")
def _(gamma_dot, p, theta, law, d, eta_min, eta_max, p_floor):  # type: ignore[no-untyped-def]
    return gamma_dot.new_empty(gamma_dot.shape)


@torch.library.register_fake("granpinn::viscosity_backward")
def _(grad, gamma_dot, p, theta, law, d, eta_min, eta_max, p_floor):  # type: ignore[no-untyped-def]
    return (
        gamma_dot.new_empty(gamma_dot.shape),
        gamma_dot.new_empty(gamma_dot.shape),
        theta.new_empty(theta.shape),
    )


@torch.library.register_fake("granpinn::pointwise_residuals")
def _(raw_jets, theta, physics, form, law):  # type: ignore[no-untyped-def]
    _require(form in RESIDUALS, "form must be 'mixed' or 'strong'", form)
    return raw_jets.new_empty([raw_jets.shape[1], len(RESIDUALS[form])])


@torch.library.register_fake("granpinn::sample_indices")
def _(step, seed, stream, count, population):  # type: ignore[no-untyped-def]
    return step.new_empty([count])


@torch.library.register_fake("granpinn::draw_batch")
def _(counter, table, seeds, places, points, *rest):  # type: ignore[no-untyped-def]
    interior, surface, *given = rest[5:]
    E = seeds.shape[0]
    of_points = ((interior, 3), (interior, 2), (interior, 2))
    source = (interior if given and given[0] is not None else 0, 2)
    shapes = (*of_points, (surface, 3), (surface,), (len(NAMES),), source)
    return tuple(points.new_empty([E, *shape]) for shape in shapes)


@torch.library.register_fake("granpinn::batch_loss")
def _(counter, table, seeds, *rest):  # type: ignore[no-untyped-def]
    params, theta = rest[9:11]
    E = params.shape[0]
    shapes = ((E,), (E, len(NAMES)), params.shape, theta.shape)
    return tuple(params.new_empty(shape) for shape in shapes)


@torch.library.register_fake("granpinn::orthogonalize")
def _(G, precision="fp32"):  # type: ignore[no-untyped-def]
    return G.new_empty(G.shape)


def _nothing(*arguments: object) -> None:
    """The shapes of what an operator changes in place."""


for _name in ("update", "descend"):
    torch.library.register_fake(f"granpinn::{_name}")(_nothing)


def _jet_setup(ctx, inputs, output):  # type: ignore[no-untyped-def]
    points, params, *network = inputs
    if points.requires_grad:
        raise ValueError(
            "points must not require a gradient: jets are differentiable in params alone; "
            "pass points.detach()"
        )
    ctx.save_for_backward(points, params)
    ctx.network = network


@once_differentiable
def _jet_backward(ctx, grad):  # type: ignore[no-untyped-def]
    points, params = ctx.saved_tensors
    by_params = _ops.network_jet_backward(grad, points, params, *ctx.network)
    return (None, by_params, *([None] * 4))


torch.library.register_autograd("granpinn::network_jet", _jet_backward, setup_context=_jet_setup)


def _loss_setup(ctx, inputs, output):  # type: ignore[no-untyped-def]
    _, terms, grad_params, grad_theta = output
    names = [*LossPoints._fields[:-1], "term_weights", "source"]
    for name, data in zip(names, [*inputs[2:8], inputs[15]], strict=True):
        if data is not None and data.requires_grad:
            raise ValueError(
                f"{name} must not require a gradient: the loss is differentiable in params and "
                f"theta; pass {name}.detach()"
            )
    ctx.mark_non_differentiable(terms, grad_params, grad_theta)
    ctx.save_for_backward(grad_params, grad_theta)


@once_differentiable
def _loss_backward(ctx, grad, *_others):  # type: ignore[no-untyped-def]
    grad_params, grad_theta = ctx.saved_tensors
    scale = grad.unsqueeze(-1)
    return (scale * grad_params, scale * grad_theta, *([None] * 14))


torch.library.register_autograd(
    "granpinn::residual_loss", _loss_backward, setup_context=_loss_setup
)


def _viscosity_setup(ctx, inputs, output):  # type: ignore[no-untyped-def]
    ctx.save_for_backward(*inputs[:3])
    ctx.constants = inputs[3:]


@once_differentiable
def _viscosity_backward(ctx, grad):  # type: ignore[no-untyped-def]
    return (*_ops.viscosity_backward(grad, *ctx.saved_tensors, *ctx.constants), *([None] * 5))


torch.library.register_autograd(
    "granpinn::viscosity", _viscosity_backward, setup_context=_viscosity_setup
)
