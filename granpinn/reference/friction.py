r"""The friction laws and the viscosity of the oracle, written without the code of any other part.

Equations (1), (2), (6) and (7) of the paper, with its symbols and $\rho_g = 1$:

$$ I = \frac{d\,\dot\gamma}{\sqrt{|p|}}, \qquad
   \mu(I) = \mu_s + \frac{\mu_2 - \mu_s}{1 + I_0 / I}, \qquad
   \eta = \frac{\mu(I)\, p}{\dot\gamma}, \qquad \dot\gamma = \sqrt{2\, D : D}. $$

Deviation from the paper: equation (7) prints max(eta, eta_max); a viscosity is *limited* by
eta_max, so the clamp here is eta_min <= eta <= eta_max.
"""

from __future__ import annotations

import torch
from torch import Tensor

from granpinn.physics.laws import LAWS


def friction(law: str, I: Tensor, theta: Tensor) -> Tensor:  # noqa: E741
    """mu of the law at inertial numbers I [...], for parameters theta [..., N]."""
    if law == "coulomb":
        return theta[..., 0].expand(I.shape)
    if law == "mu_of_i":
        mu_s, mu_2, I_0 = theta.unbind(-1)
        # multiplied out by I, so that I = 0 gives mu_s instead of a division by zero
        return mu_s + (mu_2 - mu_s) * I / (I_0 + I)
    if law in LAWS and not LAWS[law].compiled:  # a user's own law, which has one formula only
        value: Tensor = LAWS[law].friction(I, *theta.unbind(-1))
        return value
    raise ValueError(f"law must be mu_of_i or coulomb, got {law!r}")


def inertial_number(gamma_dot: Tensor, p: Tensor, d: float, p_floor: float) -> Tensor:
    """I = d gamma_dot / sqrt(max(|p|, p_floor)), of the shape of gamma_dot."""
    return d * gamma_dot / torch.sqrt(torch.clamp(torch.abs(p), min=p_floor))


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
    """Equations (6) and (7): eta = mu(I) p / gamma_dot, kept inside [eta_min, eta_max].

    The two limits are compared as stresses, mu p against eta gamma_dot, so that material at rest
    (gamma_dot = 0) needs no division: it has eta_max under pressure and eta_min without.
    Where a limit holds, the derivative of eta is zero.

    Args:
        gamma_dot: shear rate [N], >= 0.
        p: pressure [N]; grains under tension (p < 0) have no friction, hence eta = eta_min.
        theta: parameters of the law.
        d: grain diameter, in units of L.
        p_floor: positive pressure below which I no longer grows (keeps I finite at p = 0).
        eta_min, eta_max: limits of the viscosity, in units of rho L U.
    """
    strength = friction(law, inertial_number(gamma_dot, p, d, p_floor), theta) * p
    at_rest = gamma_dot == 0
    at_least = (strength < eta_min * gamma_dot) | (at_rest & (strength <= 0))
    at_most = (strength > eta_max * gamma_dot) & ~at_least
    flowing = ~(at_least | at_most)
    eta = strength / torch.where(flowing, gamma_dot, torch.ones_like(gamma_dot))
    eta = torch.where(at_least, torch.full_like(eta, eta_min), eta)
    return torch.where(at_most, torch.full_like(eta, eta_max), eta)
