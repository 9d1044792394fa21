r"""The equations as residuals, by nested automatic differentiation.

The raw outputs z [N, K] of a network become fields by

    strong form, K = 3 (the paper):   u = U z_0, v = U z_1, p = P z_2
    mixed form, K = 5:                u = U z_0, v = U z_1, p = P softplus(z_2),
                                      tau_1 = p z_3, tau_2 = p z_4

with tau = [[tau_1, tau_2], [tau_2, -tau_1]]. The mixed form is a deviation from the paper, which
has no stress unknowns: it needs no second derivatives, no viscosity and no clamp, and the stress
ratio s = tau / p makes the traction vanish with p at the free surface.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from granpinn.physics.constants import Physics
from granpinn.reference.friction import friction, inertial_number, viscosity, yield_stress
from granpinn.reference.network import RawNetwork, gradient, network

# gamma_dot = sqrt(... + SMOOTHING): the shear rate keeps a finite derivative in material at rest.
SMOOTHING = 1e-12


def pressure(z: Tensor, P: float) -> Tensor:
    """p from raw outputs z [..., K]: P z_2 (K = 3, the paper) or P softplus(z_2) >= 0 (K = 5)."""
    z_2 = z[..., 2]
    return P * z_2 if z.shape[-1] == 3 else -P * torch.nn.functional.logsigmoid(-z_2)


def constitutive(D_1: Tensor, D_2: Tensor, s_1: Tensor, s_2: Tensor, mu: Tensor) -> list[Tensor]:
    r"""Equation (6) without its division: $r = \dot\gamma\, s / \mu(I) - 2\,(D_1, D_2)$, each [N].

    s = tau / p is the stress ratio, |s| = mu(I) in flowing material; rigid zones drop out.
    """
    gamma_dot = shear_rate(D_1, D_2)
    return [gamma_dot * s_1 / mu - 2 * D_1, gamma_dot * s_2 / mu - 2 * D_2]


def shear_rate(D_1: Tensor, D_2: Tensor) -> Tensor:
    """gamma_dot = sqrt(2 D:D) of the deviatoric strain rate D = [[D_1, D_2], [D_2, -D_1]]."""
    return torch.sqrt(4 * (D_1**2 + D_2**2) + SMOOTHING)


def side_wall_force(u: Tensor, v: Tensor, p: Tensor, physics: Physics) -> list[Tensor]:
    r"""Friction of side walls per volume, $f = -k\, p\, v / |v|$, each component [N].

    k = 2 mu_w / W for walls at the distance W (Jop, Forterre and Pouliquen 2005, J. Fluid Mech.
    541, 167-192). Deviation: $|v|^2 = u^2 + v^2 + s^2$ is smooth in grains at rest.
    """
    speed = torch.stack([u, v, torch.full_like(u, physics.side_wall_speed)]).norm(dim=0)
    return [-physics.side_wall * p * component / speed for component in (u, v)]


def residuals(
    raw: RawNetwork,
    points: Tensor,
    theta: Tensor,
    physics: Sequence[float],
    form: str,
    law: str = "mu_of_i",
    source: Tensor | None = None,
) -> Tensor:
    """Residuals of the equations at the points: [N, 3] strong, [N, 5] mixed.

    Args:
        raw: any differentiable map from points [N, 3] to raw outputs [N, K], row by row.
        source: force per mass S beside gravity, [N, 2] at the points; None: none.
    """
    points = points.detach().requires_grad_()
    z, constants = raw(points), Physics(*physics)
    force = torch.stack([torch.full_like(z[:, 0], g) for g in (constants.g_x, constants.g_y)], 1)
    if source is not None:
        force = force + source
    if form == "strong":
        return _strong_form(z, points, theta, constants, force, law)
    if form == "mixed":
        return _mixed_form(z, points, theta, constants, force, law)
    raise ValueError(f'form must be "strong" or "mixed", got "{form}"')


def _strong_form(
    z: Tensor, points: Tensor, theta: Tensor, physics: Physics, force: Tensor, law: str
) -> Tensor:
    r"""(e_u, e_v, div v) [N, 3] of equations (3a) and (3b):

    $$ e = \partial_t v + v \cdot \nabla v + \nabla p - \nabla \cdot (2 \eta D) - (g + S) - f, $$

    with `force` g + S [N, 2] and the force f of `side_wall_force`. The divergence differentiates
    the stress 2 eta D itself, with eta in it. A network of the mixed form has a strong residual
    too: that of its first three fields.
    """
    u = physics.velocity_scale * z[:, 0]
    v = physics.velocity_scale * physics.v_factor * z[:, 1]
    p = pressure(z, physics.pressure_scale)
    u_x, u_y, u_t = gradient(u, points).unbind(1)
    v_x, v_y, v_t = gradient(v, points).unbind(1)
    p_x, p_y, _ = gradient(p, points).unbind(1)

    D_xx, D_xy, D_yy = u_x, (u_y + v_x) / 2, v_y
    gamma_dot = torch.sqrt(2 * (D_xx**2 + 2 * D_xy**2 + D_yy**2) + SMOOTHING)
    c = physics
    limits = (c.grain_diameter, c.eta_min, c.eta_max, c.pressure_floor)
    eta = viscosity(gamma_dot, p, theta, *limits, law)
    tau_xx_x, _, _ = gradient(2 * eta * D_xx, points).unbind(1)
    tau_xy_x, tau_xy_y, _ = gradient(2 * eta * D_xy, points).unbind(1)
    _, tau_yy_y, _ = gradient(2 * eta * D_yy, points).unbind(1)

    e_u = u_t + u * u_x + v * u_y + p_x - (tau_xx_x + tau_xy_y) - force[:, 0]
    e_v = v_t + u * v_x + v * v_y + p_y - (tau_xy_x + tau_yy_y) - force[:, 1]
    f_x, f_y = side_wall_force(u, v, p, physics)
    e_u, e_v = e_u - f_x, e_v - f_y
    return torch.stack([e_u, e_v, u_x + v_y], dim=1)


def _mixed_form(
    z: Tensor, points: Tensor, theta: Tensor, physics: Physics, force: Tensor, law: str
) -> Tensor:
    r"""(e_u, e_v, div v, r_1, r_2) [N, 5] of (3a) and (3b) with the stress as an unknown,

    $$ e = \partial_t v + v \cdot \nabla v + \nabla p - \nabla \cdot \tau - (g + S) - f, $$

    and of the friction law as `constitutive` writes it, times $(1 + (\dot\gamma/c)^2)^{-1/2}$ with
    the rate c = `law_rate`.
    """
    u = physics.velocity_scale * z[:, 0]
    v = physics.velocity_scale * physics.v_factor * z[:, 1]
    p = pressure(z, physics.pressure_scale)
    s_1, s_2 = z[:, 3], z[:, 4]
    u_x, u_y, u_t = gradient(u, points).unbind(1)
    v_x, v_y, v_t = gradient(v, points).unbind(1)
    p_x, p_y, _ = gradient(p, points).unbind(1)
    tau_1_x, tau_1_y, _ = gradient(p * s_1, points).unbind(1)
    tau_2_x, tau_2_y, _ = gradient(p * s_2, points).unbind(1)

    e_u = u_t + u * u_x + v * u_y + p_x - (tau_1_x + tau_2_y) - force[:, 0]
    e_v = v_t + u * v_x + v * v_y + p_y - (tau_2_x - tau_1_y) - force[:, 1]
    f_x, f_y = side_wall_force(u, v, p, physics)
    e_u, e_v = e_u - f_x, e_v - f_y

    D_1, D_2 = (u_x - v_y) / 2, (u_y + v_x) / 2
    gamma_dot = shear_rate(D_1, D_2)
    inertia = inertial_number(gamma_dot, p, physics.grain_diameter, physics.pressure_floor)
    limit = (1 + (gamma_dot / physics.law_rate) ** 2).rsqrt()
    stress, strength = (s_1, s_2), friction(law, inertia, theta)
    if law == "cohesive":  # |s| has no bound at p = 0: tau and c + mu p in the place of s and mu
        stress, strength = (p * s_1, p * s_2), yield_stress(law, inertia, p, theta)
    r_1, r_2 = (limit * r for r in constitutive(D_1, D_2, *stress, strength))
    return torch.stack([e_u, e_v, u_x + v_y, r_1, r_2], dim=1)


def pointwise_residuals(
    raw_jets: Tensor,
    theta: Tensor,
    physics: Sequence[float],
    form: str,
    law: str = "mu_of_i",
) -> Tensor:
    r"""Residuals [N, 3] or [N, 5] of fields that are given by their raw jets [C, N, K].

    At each point the raw outputs are replaced by their Taylor polynomial about that point,

    $$ z(\delta) = z + z_x \delta_x + z_y \delta_y + z_t \delta_t
       + (z_{xx} \delta_x^2 + 2 z_{xy} \delta_x \delta_y + z_{yy} \delta_y^2) / 2, $$

    which has the same jet at delta = 0 and therefore the same residuals.
    """

    def taylor(delta: Tensor) -> Tensor:
        d_x, d_y, d_t = delta.unsqueeze(2).unbind(1)
        z, z_x, z_y, z_t, *second = raw_jets.unbind(0)
        polynomial = z + z_x * d_x + z_y * d_y + z_t * d_t
        if second:
            z_xx, z_xy, z_yy = second
            polynomial = polynomial + z_xx * d_x**2 / 2 + z_xy * d_x * d_y + z_yy * d_y**2 / 2
        return polynomial

    points = raw_jets.new_zeros(raw_jets.shape[1], 3)
    return residuals(taylor, points, theta, physics, form, law)


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
    """(e_u, e_v, div v) [N, 3] of the strong form, for a network of either form."""
    raw = network(params, widths, input_shift, input_scale)
    return residuals(raw, points, theta, physics, "strong", law).detach()
