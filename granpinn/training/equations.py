r"""The equations of the mixed form as the last-layer step takes them, in plain torch and float64.

They are those of the training (csrc/math/mixed_form.h) but for two things in the friction law.

**A mean strain rate where mu(I) is ill-posed.** There strain gathers in bands as thin as anything
lets them be: a few grains, or a few cells of the solver that made the data. Within a band the law
does not hold point by point but for the mean over such a length L, so the law has

$$ \hat\gamma^2 = \dot\gamma^2 + \min(1, 4 C)_+ (\bar\gamma^2 - \dot\gamma^2), $$

with $\bar\gamma$ from the mean of D over four points at $\pm L/\sqrt{2}$ along x and y, and C of
`rheology.ill_posedness`. To second order this is the mean 1-2-1 over three cells of size L, the one
of the simulator's friction (docs/simulator.md). L is the grain diameter, or the cell of the data's
solver where that is larger (`mean_length`).

**Errors of the pressure.** An error $\delta p$ is one of $\dot\gamma\, \delta p / p$ in the strain
rate of the law. In thin fast layers, under the free surface, that is more than anything else;
there the law has the weight

$$ w^{-2} = 1 + \left( \frac{\dot\gamma\, \delta p}{p\, \sigma} \right)^2 . $$

docs/method.md, section 8, has the measurements behind both. Everything is dimensionless.
"""

from __future__ import annotations

import torch
from torch import Tensor

from granpinn.physics import rheology

SMOOTHING = 1e-12  # gamma_dot^2 + SMOOTHING, as in training
PRESSURE_ERROR = 5e-4  # delta p: what the pressure may be off by
RATE_ERROR = 0.015  # sigma: and the strain rate
CERTAIN = 0.25  # C that is ill-posed in full

# Which fields of z (u, v, p, s_1, s_2) each residual depends on.
DEPENDS = [[0, 1, 2, 3, 4], [0, 1, 2, 3, 4], [0, 1], [0, 1, 2, 3], [0, 1, 2, 4]]


def residuals(z: Tensor, theta: Tensor, physics: list[float]) -> tuple[Tensor, Tensor]:
    """Residuals of the equations (e_u, e_v, e_c, r_1, r_2) [N, 5] and the weights w [N] of the law.

    Args:
        z: outputs of the network, their derivatives by x, y, t, and the means of those by x and y
            over the length of the law [6, N, 5].
        theta: (mu_s, mu_2, I0) at each point [N, 3].
        physics: of the problem (granpinn/training/problem.py).
    """
    d, g_x, g_y, _, _, U, P, p_floor = physics
    (u, v), (s_1, s_2) = (U * z[:, :, :2]).unbind(2), z[:, :, 3:].unbind(2)
    q = z[:, :, 2]
    p, slope = P * torch.nn.functional.softplus(q[0]), P * torch.sigmoid(q[0])
    p_x, p_y = slope * q[1], slope * q[2]
    stress_x = p_x * s_1[0] + p * s_1[1] + p_y * s_2[0] + p * s_2[2]
    stress_y = p_x * s_2[0] + p * s_2[1] - p_y * s_1[0] - p * s_1[2]
    e_u = u[3] + u[0] * u[1] + v[0] * u[2] + p_x - stress_x - g_x
    e_v = v[3] + u[0] * v[1] + v[0] * v[2] + p_y - stress_y - g_y
    two_D1, two_D2 = u[1] - v[2], u[2] + v[1]
    local = two_D1**2 + two_D2**2 + SMOOTHING
    mean = (u[4] - v[5]) ** 2 + (u[5] + v[4]) ** 2 + SMOOTHING
    gamma_dot = torch.sqrt(local + ill_posed(local, p, theta, d, p_floor) * (mean - local))
    I = rheology.inertial_number(gamma_dot, p, d, p_floor)  # noqa: E741
    rate = gamma_dot / rheology.mu_of_I(I, *theta.unbind(1))
    e = [e_u, e_v, u[1] + v[2], rate * s_1[0] - two_D1, rate * s_2[0] - two_D2]
    return torch.stack(e, 1), law_weights(p.detach(), gamma_dot.detach())


def ill_posed(square: Tensor, p: Tensor, theta: Tensor, d: float, p_floor: float) -> Tensor:
    """How far mu(I) is ill-posed, 0 to 1 [N], held; `square`: gamma_dot^2 of the points."""
    I = rheology.inertial_number(square.sqrt(), p, d, p_floor)  # noqa: E741
    return (rheology.ill_posedness(I, *theta.unbind(1)) / CERTAIN).clamp(0, 1).detach()


def law_weights(p: Tensor, gamma_dot: Tensor) -> Tensor:
    """w [N] of the residual of the friction law, see the top; never 0/0, as gamma_dot > 0."""
    return p / torch.hypot(p, gamma_dot * (PRESSURE_ERROR / RATE_ERROR))
