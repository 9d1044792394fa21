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

from granpinn.kernels import registration  # noqa: F401  (loads the operators)
from granpinn.kernels.network import NetworkSpec
from granpinn.physics.terms import LossPoints

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
    law: str = "mu_of_i",
) -> Tensor:
    """eta = mu(I) p / gamma_dot, clamped to [eta_min, eta_max], at N points: [N].

    ``gamma_dot`` and ``p`` are [N], ``theta`` the parameters of ``law``, ``d`` the grain diameter;
    I = d gamma_dot / sqrt(max(\\|p\\|, p_floor)). Differentiable in the three tensors, with
    derivative 0 where the clamp acts. (Paper, eq. eta, with min for the printed max.) NaN where an
    argument is NaN. Raises ValueError for eta_min > eta_max or a negative p_floor.
    """
    eta: Tensor = _ops.viscosity(gamma_dot, p, theta, law, d, eta_min, eta_max, p_floor)
    return eta


def residual_loss(
    params: Tensor,
    theta: Tensor,
    batch: LossPoints,
    term_weights: Tensor,
    spec: NetworkSpec,
    physics: Constants,
    law: str = "mu_of_i",
    *,
    precision: str = "fp32",
    equations: bool = True,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The loss, its terms, and its gradients by the network and the friction law, in one pass.

    The loss is sum_k term_weights_k terms_k; a term is half the weighted mean square of a residual.
    csrc/math/forms has the equations. Only ``loss`` is differentiable, in ``params`` and
    ``theta``: its backward returns the gradients that the forward computed.

    Args:
        params: parameters of the network [P].
        theta: parameters of the friction law, in its order.
        batch: the points with their data; they have no gradient.
        term_weights: one for each of granpinn.physics.terms.
        spec: of the network.
        physics: the fields of granpinn.physics.constants.Physics.
        law: a name in granpinn.physics.laws.LAWS; or one for each of E members, with commas
            between them. A row of theta then has the length of the longest law, and the values
            behind a shorter one have no effect.
        precision: "fp32", or "fast" for tensor cores, compensated to float32 in the forward
            products and halves in the backward ones; without effect on a CPU and in float64.
        equations: without them, the terms of the velocity and the surface only.

    The input map and ``physics`` are numbers, or tensors with a leading E: members of an ensemble
    can be different problems.

    Returns:
        loss [], terms, gradient by params [P], gradient by theta.

    Raises:
        ValueError, TypeError: shapes, types or devices do not fit.
    """
    *points, source = batch
    constants = (_tensor(x, params) for x in (spec.input_shift, spec.input_scale, physics))
    network = (spec.widths, *constants, spec.form if equations else "data")
    out: tuple[Tensor, Tensor, Tensor, Tensor] = _ops.residual_loss(
        params, theta, *points, term_weights, *network, law, precision, source
    )
    return out


def _tensor(values: Constants, like: Tensor) -> Tensor:
    return values if isinstance(values, Tensor) else like.new_tensor(values)


def pointwise_residuals(
    raw_jets: Tensor,
    theta: Tensor,
    physics: Sequence[float],
    form: str,
    law: str = "mu_of_i",
) -> Tensor:
    """Residuals [N, R] of the equations from raw network jets [C, N, K].

    "strong": C = 7, R = 3 (e_u, e_v, div v), K = 3 or 5 (the network of the mixed form);
    "mixed": C = 4, K = 5, R = 5 (e_u, e_v, div v, r_1, r_2). No gradient.
    """
    residuals: Tensor = _ops.pointwise_residuals(raw_jets, theta, physics, form, law)
    return residuals


def strong_residual(
    points: Tensor,
    params: Tensor,
    theta: Tensor,
    widths: Sequence[int],
    input_shift: Sequence[float],
    input_scale: Sequence[float],
    physics: Sequence[float],
    law: str = "mu_of_i",
) -> Tensor:
    """(e_u, e_v, div v) [N, 3] of the strong form, for a network of either form. No gradient."""
    with torch.no_grad():
        jets = network_jet(points, params, widths, input_shift, input_scale, 2)
    return pointwise_residuals(jets, theta, physics, "strong", law)


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
