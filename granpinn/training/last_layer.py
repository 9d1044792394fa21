r"""The end of a training: the last layer and the friction law once more, by one Gauss-Newton step.

All layers but the last stay as they are; their outputs h (one more is 1, for the bias) are fixed
functions of (x, y, t), and the network is z = C h. A step minimizes the loss of the training,

$$ \sum_k \frac{1}{2 n_k \sigma_k^2} \sum_i w_i^2 (r_{ik} + J_{ik} \delta)^2, $$

in all coefficients C [5, F] and mu_s, mu_2 together, on many points at once: where the descent
leaves them with the scatter of its small batches, this is exact.

The equations are those of the training but for the friction law, which sees a mean strain rate
where it is ill-posed and counts less where an error of the pressure tells (`equations.py`). Closer
to the lowest points than the length of that mean it does not count: there is no data below.

docs/method.md, section 8, has the measurements behind it. Everything is dimensionless and float64.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.data import TrainingSet
from granpinn.training.equations import DEPENDS, residuals
from granpinn.training.features import Features, coefficients, with_coefficients
from granpinn.training.problem import Problem
from granpinn.training.sampling import LAST_LAYER, draw

POINTS, SURFACE_POINTS, DATA_POINTS = 32768, 8192, 262144  # at most: equations, surface, velocity
CHUNK = {"cpu": 2048, "cuda": 8192}  # points per evaluation: bounds the memory
RIDGE = 1e-7  # on the coefficients, as a part of the diagonal of the normal equations
HALVINGS = 4  # of a step that does not lower the loss, or is too long
LONGEST = 0.1  # step of mu_s and mu_2, relative: a longer one is not a correction


class Unknowns(NamedTuple):
    """C [5, F] and theta = (mu_s, mu_2, I0) [3], of which I0 is held."""

    C: Tensor
    theta: Tensor


@dataclass(frozen=True)
class Data:
    """What the sums run over.

    Attributes:
        points, weights: of the equations, [N, 3] and [N].
        surface_points, surface_pressure: [M, 3] and [M].
        moments: of the velocity, see `velocity_moments`.
        floor: y of the lowest points of all.
    """

    points: Tensor
    weights: Tensor
    surface_points: Tensor
    surface_pressure: Tensor
    moments: tuple[Tensor, Tensor, Tensor]
    floor: Tensor


def choose(data: TrainingSet, features: Features, seed: int, step: int) -> Data:
    """The points of the sums, a function of (seed, step); the velocity is taken at all of them."""
    i = draw(seed, step, LAST_LAYER, min(POINTS, len(data.points)), data.points)
    surface = data.surface_points
    j = draw(seed, step, LAST_LAYER + 1, min(SURFACE_POINTS, len(surface)), surface)
    k = torch.arange(len(data.points), device=data.points.device)
    if len(k) > DATA_POINTS:
        k = draw(seed, step, LAST_LAYER + 2, DATA_POINTS, data.points)
    moments = velocity_moments(
        features, data.points[k], data.velocity[k].double(), data.point_weights[k, 0].double()
    )
    return Data(
        data.points[i],
        data.point_weights[i, 1].double(),
        surface[j],
        data.surface_pressure[j].double(),
        moments,
        data.lower[1],
    )


def velocity_moments(
    features: Features, points: Tensor, velocity: Tensor, weights: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Weighted means of h h^T [F, F], v h^T [2, F] and v^2 [2]: all that the misfit needs."""
    parts = []
    for rows in _chunks(points):
        h = features.jet(points[rows], 0)[0]
        weighted = weights[rows, None] * velocity[rows]
        own = ((h * weights[rows, None]).T @ h, weighted.T @ h, (weighted * velocity[rows]).sum(0))
        parts.append(own)
    return tuple(torch.stack(part).sum(0) / len(points) for part in zip(*parts, strict=True))  # type: ignore[return-value]


# Weighted residuals [n, R], h [6 or 1, n, F], leaves z and theta, and which fields of z each
# residual depends on.
Rows = tuple[Tensor, Tensor, Tensor, Tensor, list[list[int]]]


class Sums:
    """The sums of one problem over its points."""

    def __init__(self, features: Features, problem: Problem, data: Data) -> None:
        self.problem, self.data = problem, data
        length = problem.mean_length
        self.h = [features.with_means(data.points[rows], length) for rows in _chunks(data.points)]
        self.h_surface = features.jet(data.surface_points, 0)[0]
        velocity, surface, momentum, continuity, law = problem.term_weights
        N, M = max(1, len(data.points)), max(1, len(data.surface_points))
        like = data.weights
        sigmas = like.new_tensor([momentum, momentum, continuity, law, law])
        self._weights = (data.weights[:, None] * sigmas / N).sqrt()
        self._weights[:, 3:] *= (data.points[:, 1:2] >= data.floor + length).double()
        self._velocity, self._surface = velocity * problem.physics[5] ** 2, (surface / M) ** 0.5
        self._law: Tensor | None = None  # held from the first evaluation on

    def loss(self, at: Unknowns) -> float:
        """The loss, with the law's weights of the first evaluation."""
        with torch.no_grad():
            rows = [r.square().sum() for r, *_ in self._rows(at)]
        return (float(torch.stack(rows).sum()) + self._misfit(at)[0]) / 2

    def normal_equations(self, at: Unknowns) -> tuple[Tensor, Tensor]:
        """J^T J [K, K] and J^T r [K]; K = 5 F + 2: C row by row, then mu_s and mu_2."""
        F = at.C.shape[1]
        K = 5 * F + 2
        A, b = at.C.new_zeros(K, K), at.C.new_zeros(K)
        _, slope, h_h = self._misfit(at)
        for k in (0, 1):
            own = slice(k * F, (k + 1) * F)
            A[own, own] += self._velocity * h_h
            b[own] += slope[k]
        for r, h, z, theta, fields in self._rows(at):
            for column, used in zip(r.unbind(1), fields, strict=True):
                by_z, by_theta = torch.autograd.grad(
                    column.sum(), (z, theta), retain_graph=True, materialize_grads=True
                )
                by_C = torch.einsum("cnk,cnf->nkf", by_z[..., used], h).flatten(1)
                J = torch.cat([by_C, by_theta[:, :2]], 1)
                i = torch.arange(K, device=A.device).unfold(0, F, F)[used].flatten()
                i = torch.cat([i, i.new_tensor([K - 2, K - 1])])
                A[i[:, None], i] += J.T @ J
                b[i] += J.T @ column.detach()
        return A, b

    def _misfit(self, at: Unknowns) -> tuple[float, Tensor, Tensor]:
        """Twice the velocity's part of the loss, its gradient [2, F], and the mean of h h^T."""
        h_h, v_h, v_v = self.data.moments
        U = self.problem.physics[5]
        C = at.C[:2]
        square = ((C @ h_h) * C).sum() - 2 * (C * v_h).sum() / U + v_v.sum() / U**2
        return self._velocity * float(square), self._velocity * (C @ h_h - v_h / U), h_h

    def _rows(self, at: Unknowns) -> Iterator[Rows]:
        first, laws = 0, []
        for h in self.h:
            rows = slice(first, first + h.shape[1])
            first = rows.stop
            z, theta = self._leaves(at, h)
            e, law = residuals(z, theta, self.problem.physics)
            laws.append(law)
            held = law if self._law is None else self._law[rows]
            one = torch.ones_like(held)
            w = torch.stack([one, one, one, held, held], 1) * self._weights[rows]
            yield e * w, h, z, theta, DEPENDS
        if self._law is None:
            self._law = torch.cat(laws)
        if len(self.h_surface):
            z, theta = self._leaves(at, self.h_surface[None])
            p = self.problem.physics[6] * torch.nn.functional.softplus(z[0, :, 2])
            r = (p - self.data.surface_pressure) * self._surface
            yield r[:, None], self.h_surface[None], z, theta, [[2]]

    @staticmethod
    def _leaves(at: Unknowns, h: Tensor) -> tuple[Tensor, Tensor]:
        z, theta = h @ at.C.T, at.theta.expand(h.shape[1], 3).clone()
        return z.requires_grad_(torch.is_grad_enabled()), theta.requires_grad_(z.requires_grad)


def solve(A: Tensor, b: Tensor, ridge: float = RIDGE) -> Tensor | None:
    """The step [K] of the normal equations; None where they are not positive definite.

    Args:
        ridge: added to the unit diagonal of the scaled equations, but not for mu_s and mu_2. The
            hidden units are nearly dependent, and directions that no data fix are to stay.
    """
    scale = A.diagonal().sqrt().clamp_min(1e-30)
    scaled = A / scale / scale[:, None]
    scaled.diagonal()[:-2] += ridge
    factor, fault = torch.linalg.cholesky_ex(scaled)
    if int(fault):
        return None
    return -torch.cholesky_solve((b / scale)[:, None], factor)[:, 0] / scale


def improve(sums: Sums, at: Unknowns) -> Unknowns:
    """The unknowns after a Gauss-Newton step from `at`.

    Where a step would not lower the loss or is too long, half of it is tried, and so on; `at` where
    all fail.
    """
    before = sums.loss(at)
    with torch.enable_grad():
        x = solve(*sums.normal_equations(at))
    if x is None:
        return at
    for part in (x * 0.5**halving for halving in range(HALVINGS + 1)):
        theta = at.theta.clone()
        theta[:2] += part[-2:]
        found = Unknowns(at.C + part[:-2].view_as(at.C), theta)
        short = bool((part[-2:].abs() <= LONGEST * at.theta[:2]).all() & (theta[0] < theta[1]))
        if short and sums.loss(found) < before:  # never where one is not a number
            return found
    return at


def last_layer(
    problem: Problem, data: TrainingSet, params: Tensor, theta: Tensor, seed: int, step: int
) -> tuple[Tensor, Tensor]:
    """params [P] and theta [3] of a trained network of the mixed form after the step, if any.

    Args:
        problem: with the weights of the end of the training.
        data: on the device of `params`.
        seed, step: of the member; they choose the points.
    """
    spec = problem.spec
    features = Features(spec, params)
    sums = Sums(features, problem, choose(data, features, seed, step))
    found = improve(sums, Unknowns(coefficients(spec, params), theta.double()))
    return with_coefficients(spec, params, found.C), found.theta.to(theta)


def _chunks(points: Tensor) -> list[slice]:
    size = CHUNK[points.device.type]
    ends = [*range(0, len(points), size), len(points)]
    return [slice(first, end) for first, end in pairwise(ends)]
