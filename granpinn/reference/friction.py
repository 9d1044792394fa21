r"""The friction laws and the viscosity of the oracle, written without the code of any other part.

Equations (1), (2), (6) and (7) of the paper, with its symbols and $\rho_g = 1$:

$$ I = \frac{d\,\dot\gamma}{\sqrt{|p|}}, \qquad
   \mu(I) = \mu_s + \frac{\mu_2 - \mu_s}{1 + I_0 / I}, \qquad
   \eta = \frac{\mu(I)\, p}{\dot\gamma}, \qquad \dot\gamma = \sqrt{2\, D : D}. $$

Deviation from the paper: equation (7) prints max(eta, eta_max); a viscosity is *limited* by
eta_max, so the clamp here is eta_min <= eta <= eta_max.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor

from granpinn.physics.laws import LAWS


def friction(law: str, I: Tensor, theta: Tensor) -> Tensor:
    """mu of the law at inertial numbers I [...], for parameters theta [..., N]."""
    if law == "coulomb":
        return theta[..., 0].expand(I.shape)
    if law in ("mu_of_i", "cohesive"):
        mu_s, mu_2, I_0 = theta[..., :3].unbind(-1)
        # multiplied out by I, so that I = 0 gives mu_s instead of a division by zero
        return mu_s + (mu_2 - mu_s) * I / (I_0 + I)
    if law == "power":
        mu_s, b, n = theta.unbind(-1)
        return mu_s + b * (I + 1e-30) ** n
    if law == "regularised":
        return _regularised(I, theta)
    if law == "free":
        return _free(I, theta)
    if law in LAWS and not LAWS[law].compiled:  # a user's own law, which has one formula only
        value: Tensor = LAWS[law].friction(I, *theta.unbind(-1))
        return value
    known = "mu_of_i, coulomb, regularised, power, cohesive or free"
    raise ValueError(f"law must be {known}, got {law!r}")


def yield_stress(law: str, I: Tensor, p: Tensor, theta: Tensor) -> Tensor:
    """The stress |tau| at which grains flow [...]: mu p, and c + mu p with cohesion."""
    friction_part = friction(law, I, theta) * p
    return theta[..., 3] + friction_part if law == "cohesive" else friction_part


def _regularised(I: Tensor, theta: Tensor) -> Tensor:
    """Barker and Gray (2017), with A of equation (6.4); I + 1e-30 in the place of I below I_1."""
    mu_s, mu_2, I_0, mu_inf, alpha, I_1 = theta.unbind(-1)

    def inertial(at: Tensor) -> Tensor:
        return (mu_s * I_0 + mu_2 * at + mu_inf * at**2) / (I_0 + at)

    log_A = torch.log(I_1) + alpha / inertial(I_1) ** 2
    # each branch sees its own I only, so that neither spoils the gradient of the other
    slow = I_1 > I
    creep = torch.sqrt(alpha / (log_A - torch.log(torch.where(slow, I + 1e-30, I_1))))
    return torch.where(slow, creep, inertial(torch.where(slow, I_1, I)))


def _free(I: Tensor, theta: Tensor) -> Tensor:
    """The B-spline by the recursion of Cox and de Boor on its knots, in powers of I_high/I_low."""
    *c, I_low, I_high = theta.unbind(-1)
    intervals = len(c) - 3
    place = torch.log(I / I_low + 1e-30) / torch.log(I_high / I_low) * intervals
    place = place.clamp(0, intervals)
    # half-open intervals; the right end belongs to the last one
    interval = place.detach().floor().clamp(max=intervals - 1)
    basis = [(interval == j).to(place) for j in range(-3, intervals + 3)]
    for degree in (1, 2, 3):
        basis = [
            ((place - j) * left + (j + degree + 1 - place) * right) / degree
            for j, (left, right) in enumerate(pairwise(basis), -3)
        ]
    return torch.stack([ck * B for ck, B in zip(c, basis, strict=True)]).sum(0)


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

    Cohesion c adds to mu p. The two limits are compared as stresses, mu p against eta gamma_dot,
    so that material at rest (gamma_dot = 0) needs no division: it has eta_max under pressure and
    eta_min without. Where a limit holds, the derivative of eta is zero.

    Args:
        gamma_dot: shear rate [N], >= 0.
        p: pressure [N]; grains under tension (p < 0) have no friction, hence eta = eta_min
            without cohesion.
        theta: parameters of the law.
        d: grain diameter, in units of L.
        p_floor: positive pressure below which I no longer grows (keeps I finite at p = 0).
        eta_min, eta_max: limits of the viscosity, in units of rho L U.
    """
    strength = yield_stress(law, inertial_number(gamma_dot, p, d, p_floor), p, theta)
    at_rest = gamma_dot == 0
    at_least = (strength < eta_min * gamma_dot) | (at_rest & (strength <= 0))
    at_most = (strength > eta_max * gamma_dot) & ~at_least
    flowing = ~(at_least | at_most)
    eta = strength / torch.where(flowing, gamma_dot, torch.ones_like(gamma_dot))
    eta = torch.where(at_least, torch.full_like(eta, eta_min), eta)
    return torch.where(at_most, torch.full_like(eta, eta_max), eta)
