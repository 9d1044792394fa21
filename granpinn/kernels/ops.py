"""The compiled kernels as torch operators.

Everything here is dimensionless (``granpinn.physics.scales``). A network with
``widths = [3, h1, ..., K]`` has one flat parameter vector: per layer W [out, in] row-major, then
b [out]. Parameters may carry a leading ensemble axis E ([E, P]); the other tensors then have it too
or are shared. float32 and float64. ``granpinn.reference`` holds the same functions written with
nested autograd.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from granpinn.kernels import op_rules  # noqa: F401  (loads and registers the operators)

_ops = torch.ops.granpinn

Constants = Sequence[float] | Tensor


def network_value(
    points: Tensor,
    params: Tensor,
    widths: Sequence[int],
    input_shift: Sequence[float],
    input_scale: Sequence[float],
) -> Tensor:
    """The network's raw outputs [N, K] at ``points`` [N, 3] = (x, y, t).

    Inputs are mapped first, xi_i = (x_i - input_shift_i) * input_scale_i. Differentiable in
    ``params``. Raises ValueError or TypeError where shapes, types or devices do not fit.
    """
    jet: Tensor = _ops.network_jet(points, params, widths, input_shift, input_scale, 0)
    return jet.squeeze(-3)


def network_jet(
    points: Tensor,
    params: Tensor,
    widths: Sequence[int],
    input_shift: Sequence[float],
    input_scale: Sequence[float],
    order: int,
) -> Tensor:
    """Raw outputs with their derivatives by x, y, t: [C, N, K].

    ``order`` 1: C = 4 channels (value, x, y, t); 2: C = 7 (and xx, xy, yy). Differentiable in
    ``params``; ``points`` are constants (ValueError if they require a gradient).
    """
    jet: Tensor = _ops.network_jet(points, params, widths, input_shift, input_scale, order)
    return jet


def viscosity(
    gamma_dot: Tensor,
    p: Tensor,
    theta: Tensor,
    d: float,
    eta_min: float,
    eta_max: float,
    p_floor: float,
) -> Tensor:
    """eta = mu(I) p / gamma_dot, clamped to [eta_min, eta_max], at N points: [N].

    ``gamma_dot`` and ``p`` are [N], ``theta`` [3] = (mu_s, mu_2, I0), ``d`` the grain diameter;
    I = d gamma_dot / sqrt(max(\\|p\\|, p_floor)). Differentiable in the three tensors, with
    derivative 0 where the clamp acts. (Paper, eq. eta, with min for the printed max.)
    """
    eta: Tensor = _ops.viscosity(gamma_dot, p, theta, d, eta_min, eta_max, p_floor)
    return eta


def residual_loss(
    params: Tensor,
    theta: Tensor,
    points: Tensor,
    velocity: Tensor,
    point_weights: Tensor,
    surface_points: Tensor,
    surface_pressure: Tensor,
    term_weights: Tensor,
    widths: Sequence[int],
    input_shift: Constants,
    input_scale: Constants,
    physics: Constants,
    form: str,
    precision: str = "fp32",
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Loss, its terms, and its gradient by parameters and rheology, in one pass.

    ``theta`` [3] = (mu_s, mu_2, I0); ``points`` [N, 3] with measured ``velocity`` [N, 2] and
    ``point_weights`` [N, 2] (of the velocity misfit, of the equations); ``surface_points`` [M, 3]
    with ``surface_pressure`` [M]; ``term_weights`` [5] in the order of ``op_rules.TERMS``;
    ``physics`` = [d, g_x, g_y, eta_min, eta_max, U, P, p_floor]; ``form`` "mixed" (K = 5),
    "strong" (K = 3) or "data" (no equations, values only; K = 3 or 5). csrc/math/mixed_form.h and
    strong_form.h state the equations. The input map and ``physics`` are numbers, or tensors that
    may have the leading E: members of an ensemble can be different problems. ``precision`` "fast"
    lets a GPU use its tensor cores, compensated to float32 in the forward products and halves in
    the backward ones; it changes nothing on a CPU and in float64.

    Returns (loss [], terms [5], grad_params [P], grad_theta [3]); terms are unweighted mean squares
    over two, loss = sum_k term_weights_k terms_k. Only ``loss`` is differentiable, in ``params``
    and ``theta``: its backward hands out the returned gradients.
    """
    out: tuple[Tensor, Tensor, Tensor, Tensor] = _ops.residual_loss(
        params,
        theta,
        points,
        velocity,
        point_weights,
        surface_points,
        surface_pressure,
        term_weights,
        widths,
        *(_tensor(values, params) for values in (input_shift, input_scale, physics)),
        form,
        precision,
    )
    return out


def _tensor(values: Constants, like: Tensor) -> Tensor:
    return values if isinstance(values, Tensor) else like.new_tensor(values)


def pointwise_residuals(
    raw_jets: Tensor, theta: Tensor, physics: Sequence[float], form: str
) -> Tensor:
    """Residuals [N, R] of the equations from raw network jets [C, N, K].

    "strong": C = 7, R = 3 (e_u, e_v, div v), K = 3 or 5 (the network of the mixed form);
    "mixed": C = 4, K = 5, R = 5 (e_u, e_v, div v, r_1, r_2). No gradient.
    """
    residuals: Tensor = _ops.pointwise_residuals(raw_jets, theta, physics, form)
    return residuals


def strong_residual(
    points: Tensor,
    params: Tensor,
    theta: Tensor,
    widths: Sequence[int],
    input_shift: Sequence[float],
    input_scale: Sequence[float],
    physics: Sequence[float],
) -> Tensor:
    """(e_u, e_v, div v) [N, 3] of the strong form, for a network of either form. No gradient."""
    with torch.no_grad():
        jets = network_jet(points, params, widths, input_shift, input_scale, 2)
    return pointwise_residuals(jets, theta, physics, "strong")


def sample_indices(
    seed: int,
    step: int | Tensor,
    stream: int,
    count: int,
    population: int,
    device: torch.device | str = "cpu",
) -> Tensor:
    """``count`` indices in [0, population), drawn with replacement: int64 [count].

    A pure function of (seed, step, stream) by Philox4x32-10, the same on every device. ``step`` may
    be an int64 tensor that lives on the device.
    """
    at = step if isinstance(step, Tensor) else torch.tensor(step, device=device)
    indices: Tensor = _ops.sample_indices(at, seed, stream, count, population)
    return indices
