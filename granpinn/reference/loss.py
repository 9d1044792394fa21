r"""The training loss, equations (10), (11) and (14) of the paper, and its gradient by autograd."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from granpinn.physics.constants import Physics
from granpinn.physics.terms import NAMES, RESIDUALS, LossPoints
from granpinn.reference.equations import pressure, residuals
from granpinn.reference.network import member, network

if TYPE_CHECKING:
    from granpinn.kernels.network import NetworkSpec


def loss_terms(
    params: Tensor,
    theta: Tensor,
    batch: LossPoints,
    spec: NetworkSpec,
    physics: Sequence[float],
    law: str = "mu_of_i",
    *,
    equations: bool = True,
) -> Tensor:
    r"""The five terms [5] of one network, differentiable in params and theta.

    With N points (weights w_v for the velocity, w_f for the equations) and M surface points:

        velocity      1/(2N) sum w_v ((u - u_data)^2 + (v - v_data)^2)    equation (10)
        surface       1/(2M) sum (p - p_surface)^2                        equation (14)
        momentum      1/(2N) sum w_f (e_u^2 + e_v^2)                      equation (11)
        continuity    1/(2N) sum w_f (div v)^2                            equation (11)
        constitutive  1/(2N) sum w_f (r_1^2 + r_2^2)                      mixed form

    A term over no points, or of equations that the form does not have, is 0; without `equations`
    there are none.
    """
    raw = network(params, spec.widths, spec.input_shift, spec.input_scale)
    constants = Physics(*physics)
    points, velocity, point_weights, surface_points, surface_pressure, source = batch
    w_v, w_f = point_weights.unbind(1)

    scale = constants.velocity_scale * velocity.new_tensor([1.0, constants.v_factor])
    misfit = scale * raw(points)[:, :2] - velocity
    misfit_surface = pressure(raw(surface_points), constants.pressure_scale) - surface_pressure
    names = RESIDUALS[spec.form] if equations else ()
    at = (points, theta, physics, spec.form, law, source)
    e = residuals(raw, *at) if equations else misfit.new_zeros(len(points), 0)
    terms = {
        "velocity": _half_mean(w_v, misfit),
        "surface": _half_mean(torch.ones_like(surface_pressure), misfit_surface.unsqueeze(1)),
    }
    for name in NAMES[len(terms) :]:
        first = names.index(name) if name in names else 0
        terms[name] = _half_mean(w_f, e[:, first : first + names.count(name)])
    return torch.stack(list(terms.values()))


def _half_mean(weights: Tensor, vectors: Tensor) -> Tensor:
    """1/(2N) sum of weights [N] times |vectors [N, .]|^2."""
    return (weights * (vectors**2).sum(1)).sum() / (2 * max(len(vectors), 1))


def residual_loss(
    params: Tensor,
    theta: Tensor,
    batch: LossPoints,
    term_weights: Tensor,
    spec: NetworkSpec,
    physics: Sequence[float],
    law: str = "mu_of_i",
    *,
    equations: bool = True,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """loss = sum_k term_weights_k term_k, with the terms and both gradients, all detached.

    Returns:
        loss [], terms [5], d loss / d params [P], d loss / d theta; each leads with E for an
        ensemble, whose members are evaluated one after the other.
    """
    if params.ndim == 2:
        members = []
        for e, w in enumerate(params):
            own = (w, member(theta, e, 1), batch.member(e), member(term_weights, e, 1))
            members.append(residual_loss(*own, spec, physics, law, equations=equations))
        loss, terms, grad_params, grad_theta = map(torch.stack, zip(*members, strict=True))
        return loss, terms, grad_params, grad_theta

    params, theta = params.detach().requires_grad_(), theta.detach().requires_grad_()
    terms = loss_terms(params, theta, batch, spec, physics, law, equations=equations)
    loss = (term_weights * terms).sum()
    grad_params, grad_theta = torch.autograd.grad(loss, (params, theta), materialize_grads=True)
    return loss.detach(), terms.detach(), grad_params, grad_theta
