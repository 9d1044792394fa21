r"""The mu(I) friction law in plain torch, to read, to plot and to check against.

Equations (1), (2), (6) and (7) of the paper, with its symbols:

$$ I = \frac{d\,\dot\gamma}{\sqrt{|p| / \rho_g}}, \qquad
   \mu(I) = \mu_s + \frac{\mu_2 - \mu_s}{1 + I_0 / I}, \qquad
   \eta = \frac{\mu(I)\, p}{\dot\gamma}, \qquad \dot\gamma = \sqrt{2\, D : D}. $$

Everything is dimensionless (see `granpinn.physics.scales`), so that $\rho_g = 1$.
Deviation from the paper: equation (7) prints max(eta, eta_max); a viscosity is *limited* by
eta_max, so the clamp here is eta_min <= eta <= eta_max.
"""

from __future__ import annotations

import torch
from torch import Tensor


def inertial_number(gamma_dot: Tensor, p: Tensor, d: float, p_floor: float) -> Tensor:
    """Equation (1): I = d gamma_dot / sqrt(max(|p|, p_floor)), same shape as `gamma_dot`.

    Args:
        gamma_dot: shear rate sqrt(2 D:D), in units of U/L.
        p: pressure, in units of rho |g| L.
        d: grain diameter, in units of L.
        p_floor: positive pressure below which I no longer grows (keeps I finite at p = 0).
    """
    return d * gamma_dot / torch.sqrt(torch.clamp(torch.abs(p), min=p_floor))


def mu_of_I(
    I: Tensor,  # noqa: E741 (the inertial number's own symbol)
    mu_s: Tensor | float,
    mu_2: Tensor | float,
    I_0: Tensor | float,
) -> Tensor:
    """Equation (2), multiplied out by I so that I = 0 gives mu_s instead of a division by zero."""
    return mu_s + (mu_2 - mu_s) * I / (I_0 + I)


def ill_posedness(
    I: Tensor,  # noqa: E741
    mu_s: Tensor | float,
    mu_2: Tensor | float,
    I_0: Tensor | float,
) -> Tensor:
    """C(I), positive where the equations of mu(I) are ill-posed: the shortest waves grow fastest.

    C = 4 a^2 - 4 a + mu^2 (1 - a/2)^2, a = I mu'(I) / mu(I) (Barker, Schaeffer, Bohorquez, Gray,
    J. Fluid Mech. 779, 2015).
    """
    mu = mu_of_I(I, mu_s, mu_2, I_0)
    a = I * (mu_2 - mu_s) * I_0 / (I_0 + I) ** 2 / mu
    return 4 * a**2 - 4 * a + mu**2 * (1 - a / 2) ** 2


def viscosity(
    gamma_dot: Tensor,
    p: Tensor,
    theta: Tensor,
    d: float,
    eta_min: float,
    eta_max: float,
    p_floor: float,
) -> Tensor:
    """Equations (6) and (7): eta = mu(I) p / gamma_dot, kept inside [eta_min, eta_max].

    The two limits are compared as stresses, mu p against eta gamma_dot, so that material at rest
    (gamma_dot = 0) needs no division: it has eta_max under pressure and eta_min without.
    Where a limit holds, the derivative of eta is zero.

    Args:
        gamma_dot: shear rate [N], >= 0.
        p: pressure [N]; grains under tension (p < 0) have no friction, hence eta = eta_min.
        theta: (mu_s, mu_2, I_0) [3].
        d, p_floor: as in `inertial_number`.
        eta_min, eta_max: limits of the viscosity, in units of rho L U.
    """
    mu_s, mu_2, I_0 = theta.unbind(-1)
    strength = mu_of_I(inertial_number(gamma_dot, p, d, p_floor), mu_s, mu_2, I_0) * p
    at_rest = gamma_dot == 0
    at_least = (strength < eta_min * gamma_dot) | (at_rest & (strength <= 0))
    at_most = (strength > eta_max * gamma_dot) & ~at_least
    flowing = ~(at_least | at_most)
    eta = strength / torch.where(flowing, gamma_dot, torch.ones_like(gamma_dot))
    eta = torch.where(at_least, torch.full_like(eta, eta_min), eta)
    return torch.where(at_most, torch.full_like(eta, eta_max), eta)
