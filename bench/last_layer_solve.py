r"""One Gauss-Newton step of a trained network of the mixed form, in its last layer and its law.

All layers but the last stay as they are; their outputs h (one more is 1, for the bias) are fixed
functions of (x, y, t). With coefficients C [6, F] of six combinations z = C h,

    u = U z_0, v = U z_1, p = P (softplus(z_2) + z_5), s_1 = z_3, s_2 = z_4,

the residuals of training are those of csrc/math/mixed_form.h. z_5 begins at 0: where softplus is
flat, the pressure of a thin layer could not move without it. A step minimizes

$$ \sum_k \frac{1}{2 n_k \sigma_k^2} \sum_i w_i^2 (r_{ik} + J_{ik} x)^2 $$

in all 6 F coefficients and mu_s, mu_2 together, on many points at once: where training leaves the
two with the scatter of its small batches and the slow directions of its descent, this is exact.

Everything is dimensionless and float64.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import torch
from torch import Tensor

from granpinn import ops, rheology
from granpinn.config import ConfigError
from granpinn.network import NetworkSpec, layer_offsets, views
from granpinn.training.problem import Problem

LawWeight = Literal["none", "p", "depth"]

CHUNK = 2048  # points per evaluation: bounds the memory, does not change the values
FIELDS = 6
SMOOTHING = 1e-12  # gamma_dot^2 + SMOOTHING, as in training
PRESSURE = 0.15  # law weight "p": w = p / PRESSURE
PRESSURE_ERROR = 5e-4  # law weight "depth": what the pressure may be off by
RATE_ERROR = 0.015  # and the strain rate, both dimensionless
RIDGE = 1e-7  # on the coefficients, as a part of the diagonal of the normal equations


class LastLayer(NamedTuple):
    """The unknowns: C [6, F] and theta = (mu_s, mu_2, I0) [3], of which I0 is held."""

    C: Tensor
    theta: Tensor


@dataclass(frozen=True)
class Data:
    """The points of the sums, with their weights; the names are those of TrainingSet."""

    points: Tensor
    velocity: Tensor
    point_weights: Tensor
    surface_points: Tensor
    surface_pressure: Tensor


class Normal(NamedTuple):
    """J^T J [K, K], J^T r [K] and the loss r^T r / 2, with the weights in J and r.

    K = 6 F + 2: C row by row, then mu_s and mu_2.
    """

    A: Tensor
    b: Tensor
    loss: float


class Step(NamedTuple):
    """The unknowns after a step, and the loss before it and, linearized, after it."""

    unknowns: LastLayer
    loss: float
    loss_after: float


class Features:
    """What the last layer of a network combines.

    Attributes:
        start: the unknowns as training left them.
    """

    def __init__(self, spec: NetworkSpec, params: Tensor, theta: Tensor) -> None:
        """`params` [P] and `theta` [3], on the device to work on."""
        if spec.form != "mixed":
            raise ConfigError(f"form must be mixed, got {spec.form}: identify with --form mixed")
        params, theta = params.double(), theta.double()
        W, b = views(params, spec.widths)[-1]
        C = torch.cat([W, b[:, None]], 1)
        self.start = LastLayer(torch.cat([C, torch.zeros_like(C[:1])]), theta)
        # The hidden layers, with the identity as their last one.
        n, hidden = spec.widths[-2], params[: layer_offsets(spec.widths)[-1]]
        identity = torch.eye(n, dtype=params.dtype, device=params.device).flatten()
        self._params = torch.cat([hidden, identity, identity.new_zeros(n)])
        self._network = (
            [*spec.widths[:-1], n],
            list(spec.input_shift),
            list(spec.input_scale),
        )

    def jet(self, points: Tensor) -> Tensor:
        """h and its derivatives by x, y, t at points [N, 3]: [4, N, F]."""
        h = ops.network_jet(points, self._params, *self._network, 1)
        one = torch.zeros_like(h[:, :, :1])
        one[0] = 1
        return torch.cat([h, one], 2)


def residuals(z: Tensor, theta: Tensor, physics: list[float]) -> tuple[Tensor, Tensor, Tensor]:
    """Residuals of the equations (e_u, e_v, e_c, r_1, r_2) [N, 5], and p and gamma_dot [N].

    Args:
        z: the six combinations and their derivatives by x, y, t [4, N, 6].
        theta: (mu_s, mu_2, I0) at each point [N, 3].
    """
    d, g_x, g_y, _, _, U, _, p_floor = physics
    (u, v), (s_1, s_2) = (U * z[:, :, :2]).unbind(2), z[:, :, 3:5].unbind(2)
    p, p_x, p_y = pressure(z, physics)
    stress_x = p_x * s_1[0] + p * s_1[1] + p_y * s_2[0] + p * s_2[2]
    stress_y = p_x * s_2[0] + p * s_2[1] - p_y * s_1[0] - p * s_1[2]
    e_u = u[3] + u[0] * u[1] + v[0] * u[2] + p_x - stress_x - g_x
    e_v = v[3] + u[0] * v[1] + v[0] * v[2] + p_y - stress_y - g_y
    two_D1, two_D2 = u[1] - v[2], u[2] + v[1]
    gamma_dot = torch.sqrt(two_D1**2 + two_D2**2 + SMOOTHING)
    mu_s, mu_2, I0 = theta.unbind(1)
    I = rheology.inertial_number(gamma_dot, p, d, p_floor)  # noqa: E741
    rate = gamma_dot / rheology.mu_of_I(I, mu_s, mu_2, I0)
    e = [e_u, e_v, u[1] + v[2], rate * s_1[0] - two_D1, rate * s_2[0] - two_D2]
    return torch.stack(e, 1), p.detach(), gamma_dot.detach()


def pressure(z: Tensor, physics: list[float]) -> tuple[Tensor, Tensor, Tensor]:
    """p, p_x, p_y [N] of the combinations z [4, N, 6]."""
    P, q, direct = physics[6], z[:, :, 2], z[:, :, 5]
    slope = torch.sigmoid(q[0])
    p = P * (torch.nn.functional.softplus(q[0]) + direct[0])
    return p, P * (slope * q[1] + direct[1]), P * (slope * q[2] + direct[2])


def law_weights(law_weight: LawWeight, p: Tensor, gamma_dot: Tensor) -> Tensor:
    r"""w [N] on the residual of the friction law, a difference of strain rates; held in a step.

    "p": p / 0.15, so that it is a difference of stresses. "depth": an error $\delta$ of p is one of
    $\dot\gamma \delta / p$ in that rate, so $w^{-2} = 1 + (\dot\gamma \delta / (p \sigma))^2$.
    """
    if law_weight == "none":
        return torch.ones_like(p)
    if law_weight == "p":
        return p / PRESSURE
    return p / torch.hypot(p, gamma_dot * (PRESSURE_ERROR / RATE_ERROR))  # never 0/0: SMOOTHING


def normal_equations(
    features: Features, at: LastLayer, problem: Problem, data: Data, law_weight: LawWeight
) -> Normal:
    """The sums over all points, with the weights 1/sigma^2 of `problem.term_weights`."""
    K = at.C.numel() + 2
    A, b, loss = at.C.new_zeros(K, K), at.C.new_zeros(K), 0.0
    for J, r in _rows(features, at, problem, data, law_weight):
        A += J.T @ J
        b += J.T @ r
        loss += float(r @ r) / 2
    return Normal(A, b, loss)


def _rows(
    features: Features, at: LastLayer, problem: Problem, data: Data, law_weight: LawWeight
) -> Iterator[tuple[Tensor, Tensor]]:
    """Weighted J [rows, K] and r [rows], chunk by chunk."""
    U = problem.physics[5]
    velocity, surface, momentum, continuity, law = problem.term_weights
    N, M = len(data.points), len(data.surface_points)
    sigmas = data.points.new_tensor([velocity] * 2 + [momentum] * 2 + [continuity] + [law] * 2)
    for first, end in _chunks(N):
        h = features.jet(data.points[first:end])
        z = (h @ at.C.T).requires_grad_()
        theta = at.theta.expand(end - first, 3).clone().requires_grad_()
        e, p, gamma_dot = residuals(z, theta, problem.physics)
        r = torch.cat([U * z[0, :, :2] - data.velocity[first:end], e], 1)
        w = torch.stack([torch.ones_like(p)] * 5 + [law_weights(law_weight, p, gamma_dot)] * 2, 1)
        weights = data.point_weights[first:end]
        w = w * torch.cat([weights[:, :1].expand(-1, 2), weights[:, 1:].expand(-1, 5)], 1).sqrt()
        yield _jacobian(h, z, theta, r * w * (sigmas / N).sqrt())
    for first, end in _chunks(M):
        h = features.jet(data.surface_points[first:end])
        z = (h @ at.C.T).requires_grad_()
        theta = at.theta.expand(end - first, 3).clone().requires_grad_()
        r = pressure(z, problem.physics)[0] - data.surface_pressure[first:end]
        yield _jacobian(h, z, theta, (r * (surface / M) ** 0.5)[:, None])


def _chunks(count: int) -> Iterator[tuple[int, int]]:
    return pairwise([*range(0, count, CHUNK), count]) if count else iter(())


def _jacobian(h: Tensor, z: Tensor, theta: Tensor, r: Tensor) -> tuple[Tensor, Tensor]:
    """J [N R, K] of r [N, R], which at each point depends on its own z and theta alone."""
    parts = []
    for column in r.unbind(1):
        by_z, by_theta = torch.autograd.grad(
            column.sum(), (z, theta), retain_graph=True, materialize_grads=True
        )
        by_C = torch.einsum("cnk,cnf->nkf", by_z, h).flatten(1)
        parts.append(torch.cat([by_C, by_theta[:, :2]], 1))
    return torch.cat(parts), r.detach().T.flatten()


def solve(normal: Normal, ridge: float = RIDGE) -> tuple[Tensor, float]:
    """The step x [K] of the normal equations, and the linearized loss after it.

    Args:
        ridge: added to the unit diagonal of the scaled equations, but not for mu_s and mu_2. The
            hidden units are nearly dependent, and directions that no data fix are to stay.
    """
    A, b, loss = normal
    scale = A.diagonal().sqrt().clamp_min(1e-30)
    scaled = A / scale / scale[:, None]
    diagonal = scaled.diagonal()
    diagonal[:-2] += ridge
    factor, fault = torch.linalg.cholesky_ex(scaled)
    if int(fault):
        raise ArithmeticError(
            f"the normal equations must be positive definite, and are not at unknown {int(fault)} "
            f"of {len(b)}: use a larger --ridge than {ridge:g} or more points"
        )
    x = -torch.cholesky_solve((b / scale)[:, None], factor)[:, 0] / scale
    return x, loss + float(b @ x + x @ A @ x / 2)


def step(
    features: Features,
    at: LastLayer,
    problem: Problem,
    data: Data,
    law_weight: LawWeight = "none",
    ridge: float = RIDGE,
) -> Step:
    """One Gauss-Newton step from `at`."""
    normal = normal_equations(features, at, problem, data, law_weight)
    x, after = solve(normal, ridge)
    theta = at.theta.clone()
    theta[:2] += x[-2:]
    return Step(LastLayer(at.C + x[:-2].view_as(at.C), theta), normal.loss, after)
