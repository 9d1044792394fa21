r"""The equations of the mixed form in the last-layer step, in plain torch and float64.

The training has the same equations (csrc/math/forms/mixed.h) but for two parts of the friction law.

**A mean strain rate where the law is ill-posed.** There strain gathers in very thin bands: a few
grains, or a few cells of the solver that made the data. Within a band the law does not hold at
every point, but for the mean over such a length L. So the law has

$$ \hat\gamma^2 = \dot\gamma^2 + \min(1, 4 C)_+ (\bar\gamma^2 - \dot\gamma^2), $$

with $\bar\gamma$ from the mean of D over four points at $\pm L/\sqrt{2}$ along x and y, and C of
`Law.ill_posedness`. To second order this is the mean 1-2-1 over three cells of size L, as in the
friction of the simulator (docs/explanation/simulator.md). L is the length over which the solver
that made the data takes its strain rate, and the grain diameter of real grains
(`problem.mean_length_of`).

**Errors of the pressure.** An error $\delta p$ causes an error $\dot\gamma\, \delta p / p$ of the
strain rate in the law. In thin fast layers under the free surface this is the largest error; there
the law has the weight

$$ w^{-2} = 1 + \left( \frac{\dot\gamma\, \delta p}{p\, \sigma} \right)^2 . $$

bench/studies/last_layer/note.md has the measurements behind both. Everything is dimensionless.
"""

from __future__ import annotations

import torch
from torch import Tensor

from granpinn.physics.constants import Physics
from granpinn.physics.laws import FrictionLaw

SMOOTHING = 1e-12  # gamma_dot^2 + SMOOTHING, as in training
PRESSURE_ERROR = 5e-4  # delta p, a plausible error of the pressure
RATE_ERROR = 0.015  # sigma, a plausible error of the strain rate
CERTAIN = 0.25  # C above which the law counts as fully ill-posed

# Which fields of z (u, v, p, s_1, s_2) each residual depends on.
DEPENDS = [[0, 1, 2, 3, 4], [0, 1, 2, 3, 4], [0, 1], [0, 1, 2, 3], [0, 1, 2, 4]]


def residuals(
    z: Tensor,
    theta: Tensor,
    physics: Physics,
    law: FrictionLaw,
    source: Tensor | None = None,
    kept: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """Residuals of the equations (e_u, e_v, e_c, r_1, r_2) [N, 5], and what a step keeps.

    It keeps the weights w of the law and the shares min(1, 4 C)_+ [N, 2]: they have no gradient, so
    that a step which changed them would not lower the loss that it expects to lower.

    Args:
        z: outputs of the network, their derivatives by x, y, t, and the means of the x and y
            derivatives over the length of the law [6, N, 5].
        theta: parameters of the law at each point [N, len(law.parameters)].
        source: force per mass beside gravity [N, 2]; None: none.
        kept: of an earlier evaluation; None: that of z and theta.
    """
    (u, v), (s_1, s_2) = z[:, :, :2].unbind(2), z[:, :, 3:].unbind(2)
    u, v = (scale * a for scale, a in zip(physics.velocity_scales, (u, v), strict=True))
    q, P = z[:, :, 2], physics.pressure_scale
    p, slope = P * torch.nn.functional.softplus(q[0]), P * torch.sigmoid(q[0])
    p_x, p_y = slope * q[1], slope * q[2]
    stress_x = p_x * s_1[0] + p * s_1[1] + p_y * s_2[0] + p * s_2[2]
    stress_y = p_x * s_2[0] + p * s_2[1] - p_y * s_1[0] - p * s_1[2]
    e_u = u[3] + u[0] * u[1] + v[0] * u[2] + p_x - stress_x - physics.g_x
    e_v = v[3] + u[0] * v[1] + v[0] * v[2] + p_y - stress_y - physics.g_y
    if source is not None:
        e_u, e_v = e_u - source[:, 0], e_v - source[:, 1]
    if physics.side_wall > 0:
        speed = torch.sqrt(u[0] ** 2 + v[0] ** 2 + physics.side_wall_speed**2)
        friction = physics.side_wall * p / speed
        e_u, e_v = e_u + friction * u[0], e_v + friction * v[0]
    two_D1, two_D2 = u[1] - v[2], u[2] + v[1]
    local = two_D1**2 + two_D2**2 + SMOOTHING
    mean = (u[4] - v[5]) ** 2 + (u[5] + v[4]) ** 2 + SMOOTHING
    if kept is None:
        part = ill_posed(physics.inertial_number(local.sqrt(), p), theta, law)
        gamma_dot = torch.sqrt(local + part * (mean - local))
        kept = torch.stack([law_weights(p.detach(), gamma_dot.detach()), part], 1)
    else:
        gamma_dot = torch.sqrt(local + kept[:, 1] * (mean - local))
    mu = law.friction(physics.inertial_number(gamma_dot, p), *theta.unbind(1))
    # gamma_dot p / Y with the yield stress Y = c + mu p (csrc/math/cohesion.h)
    rate = gamma_dot * p / (law.cohesion_of(theta.T) + mu * p) if law.cohesion else gamma_dot / mu
    limit = (1 + (gamma_dot / physics.law_rate) ** 2).rsqrt()
    law_errors = (limit * (rate * s[0] - two_D) for s, two_D in ((s_1, two_D1), (s_2, two_D2)))
    e = [e_u, e_v, u[1] + v[2], *law_errors]
    return torch.stack(e, 1), kept


def ill_posed(I: Tensor, theta: Tensor, law: FrictionLaw) -> Tensor:
    """How far the law is ill-posed, 0 to 1 [N], without a gradient."""
    C: Tensor = law.ill_posedness(I, theta.unbind(1))
    return (C / CERTAIN).clamp(0, 1).detach()


def law_weights(p: Tensor, gamma_dot: Tensor) -> Tensor:
    """w [N] of the residual of the friction law (see the top); gamma_dot > 0, so never 0/0."""
    return p / torch.hypot(p, gamma_dot * (PRESSURE_ERROR / RATE_ERROR))
