"""The loss of the last-layer step: its points, its residuals and its normal equations.

The layers below the last one are fixed. Their outputs h (the last one is 1, for the bias) are
functions of (x, y, t), and the network is z = C h. `last_layer.py` minimizes the loss in C and the
free parameters of the law.

The mean strain rate of the law (`equations.py`) needs data below its point. So the law has the
weight 0 at points that are closer to the lowest points than the length of the mean.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor

from granpinn.physics.laws import FrictionLaw
from granpinn.physics.terms import NAMES, RESIDUALS
from granpinn.training import curve_prior
from granpinn.training.equations import DEPENDS, residuals
from granpinn.training.features import Features
from granpinn.training.objective import LAST_LAYER, draw
from granpinn.training.points import TrainingSet
from granpinn.training.problem import Problem

BLOCKS = 4  # of columns in `gram`
RIDGE = 1e-7  # on the coefficients, as a part of the diagonal of the normal equations


class Boxes:
    """Boxes between bounds of (x, y, t), each [3], `count` along every axis; `total` of them.

    Neighbors share errors, so the residuals of a box count as one. An axis without an extent has
    one layer of boxes.
    """

    def __init__(self, lower: Tensor, upper: Tensor, count: int) -> None:
        self.lower, self.count, self.total = lower.double(), count, count**3
        self.size = (upper.double() - self.lower).clamp_min(1e-30) / count

    def number(self, points: Tensor) -> Tensor:
        """The number [n] of the box of each of the points [n, 3]; beyond the bounds the nearest."""
        lower, size = self.lower.to(points.device), self.size.to(points.device)
        k = ((points.double() - lower) / size).long().clamp(0, self.count - 1)
        return (k[:, 0] * self.count + k[:, 1]) * self.count + k[:, 2]


class PointRow(NamedTuple):
    """One residual of the equations or of the surface at n points, with its slopes.

    Attributes:
        points: which: first those of the equations, then those of the surface.
        residual: weighted [n].
        h: jets of the features [6 or 1, n, F].
        by_z: derivatives by the fields z and theirs [6 or 1, n, 5].
        by_theta: derivatives by the free parameters of the law [n, L].
        used: the fields on which it depends.
    """

    points: slice
    residual: Tensor
    h: Tensor
    by_z: Tensor
    by_theta: Tensor
    used: list[int]


POINTS, SURFACE_POINTS, DATA_POINTS = 32768, 8192, 262144  # at most: equations, surface, velocity
CHUNK = {"cpu": 2048, "cuda": 32768}  # points per evaluation: bounds the memory


class Unknowns(NamedTuple):
    """C [5, F] and theta [N]; in theta, the L free parameters of the law are unknown."""

    C: Tensor
    theta: Tensor


@dataclass(frozen=True)
class Data:
    """The points over which the loss is summed.

    Attributes:
        points, weights: of the equations, [N, 3] and [N]; `source` there, [N, 2] or None.
        surface_points, surface_pressure: [M, 3] and [M].
        moments: of the velocity, see `velocity_moments`.
        measured: points, velocity and weights of the moments, [K, 3], [K, 2] and [K].
        floor: y of the lowest points of all.
    """

    points: Tensor
    weights: Tensor
    surface_points: Tensor
    surface_pressure: Tensor
    moments: tuple[Tensor, Tensor, Tensor]
    measured: tuple[Tensor, Tensor, Tensor]
    floor: Tensor
    source: Tensor | None = None


def choose(data: TrainingSet, features: Features, seed: int, step: int, fewer: int = 1) -> Data:
    """Choose the points of the sums by (seed, step), `fewer` times fewer; all have a velocity."""
    i = draw(seed, step, LAST_LAYER, min(POINTS // fewer, len(data.points)), data.points)
    surface = data.surface_points
    j = draw(seed, step, LAST_LAYER + 1, min(SURFACE_POINTS // fewer, len(surface)), surface)
    k: Tensor | slice = slice(None)
    if len(data.points) > DATA_POINTS // fewer:
        k = draw(seed, step, LAST_LAYER + 2, DATA_POINTS // fewer, data.points)
    measured = (data.points[k], data.velocity[k].double(), data.point_weights[k, 0].double())
    return Data(
        data.points[i],
        data.point_weights[i, 1].double(),
        surface[j],
        data.surface_pressure[j].double(),
        velocity_moments(features, *measured),
        measured,
        data.lower[1],
        None if data.source is None else data.source[i].double(),
    )


def velocity_moments(
    features: Features, points: Tensor, velocity: Tensor, weights: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Weighted means of h h^T [F, F], v h^T [2, F] and v^2 [2]: they determine the misfit."""
    parts = []
    for rows in chunks(points):
        h = features.of_vectors(points[rows])
        weighted = weights[rows, None] * velocity[rows]
        own = ((h * weights[rows, None]).T @ h, weighted.T @ h, (weighted * velocity[rows]).sum(0))
        parts.append(own)
    return tuple(torch.stack(part).sum(0) / len(points) for part in zip(*parts, strict=True))  # type: ignore[return-value]


# Weighted residuals [n, R], h [6 or 1, n, F], leaves z and theta, the fields of z in each residual,
# and which points: first those of the equations, then those of the surface.
Rows = tuple[Tensor, Tensor, Tensor, Tensor, list[list[int]], slice]


class Sums:
    """The sums of one problem over its points.

    Attributes:
        free: numbers of the free parameters of the law [L].
        velocity_weight: of the mean square of U z - velocity over U^2, U the scale of the velocity.
        factors: on the outputs u and v [2, 1].
    """

    def __init__(self, features: Features, problem: Problem, law: FrictionLaw, data: Data) -> None:
        self.physics, self.law, self.data, self.features = problem.physics, law, data, features
        self.free = [k for k, p in enumerate(law.parameters) if not p.fixed]
        length = problem.mean_length
        self.h = [features.with_means(data.points[rows], length) for rows in chunks(data.points)]
        self.h_surface = features.jet(data.surface_points, 0)[0]
        weights = dict(zip(NAMES, problem.term_weights, strict=True))
        N, M = max(1, len(data.points)), max(1, len(data.surface_points))
        like = data.weights
        of_residuals = like.new_tensor([weights[name] for name in RESIDUALS["mixed"]])
        self._weights = (data.weights[:, None] * of_residuals / N).sqrt()
        self._weights[:, 3:] *= (data.points[:, 1:2] >= data.floor + length).double()
        self.velocity_weight = weights["velocity"] * self.physics.velocity_scale**2
        self.factors = like.new_tensor([[1.0], [self.physics.v_factor]])
        self._surface = (weights["surface"] / M) ** 0.5
        self._kept: Tensor | None = None  # of the law, from the first evaluation
        self.differences = curve_prior.differences(law, like)
        self.roughness = 0.0  # weight of |differences theta|^2 / 2, see curve_prior.py

    def loss(self, at: Unknowns) -> float:
        """The loss, with what the first evaluation since `weigh_anew` keeps of the law."""
        with torch.no_grad():
            rows = [r.square().sum() for r, *_ in self._rows(at)]
        return (float(torch.stack(rows).sum()) + self.misfit(at)[0]) / 2 + self._rough(at)

    def scores(self, at: Unknowns) -> Tensor:
        """The parts of J^T r from each block of points [B, K], see curve_prior.py."""
        F, points = at.C.shape[1], self.data.measured[0]
        every = torch.cat([self.data.points, self.data.surface_points, points])
        blocks = Boxes(every.amin(0), every.amax(0), curve_prior.PARTS)
        rest, measured = blocks.number(every).tensor_split([len(every) - len(points)])
        found = at.C.new_zeros(blocks.total, 5 * F + len(self.free))
        for rows, h, e, w in self.vectors(at):
            by_C = (self.factors * (w * e)[:, :, None] * h[:, None]).flatten(1)
            found[:, : 2 * F].index_add_(0, measured[rows], by_C)
        for J, r, i, which in self.jacobians(at):
            part = found.new_zeros(len(found), len(i)).index_add_(0, rest[which], J * r[:, None])
            found[:, i] += part
        return found

    def vectors(self, at: Unknowns) -> Iterator[tuple[slice, Tensor, Tensor, Tensor]]:
        """Of the measured vectors, in chunks: which they are, h [n, F], the residual of u and v
        over U [n, 2] and its weight in the loss [n, 1]."""
        points, velocity, weights = self.data.measured
        for rows in chunks(points):
            h = self.features.of_vectors(points[rows])
            e = h @ (self.factors * at.C[:2]).T - velocity[rows] / self.physics.velocity_scale
            yield rows, h, e, self.velocity_weight / len(points) * weights[rows, None]

    def normal_equations(self, at: Unknowns) -> tuple[Tensor, Tensor]:
        """J^T J [K, K] and J^T r [K]; K = 5 F + L: C row by row, then the free parameters."""
        F, K = at.C.shape[1], at.C.numel() + len(self.free)
        A, b = at.C.new_zeros(K, K), at.C.new_zeros(K)
        _, slope, h_h = self.misfit(at)
        for k in (0, 1):
            own = slice(k * F, (k + 1) * F)
            A[own, own] += self.factors[k] ** 2 * self.velocity_weight * h_h
            b[own] += slope[k]
        for J, r, i, _ in self.jacobians(at):
            A[i[:, None], i] += gram(J)
            b[i] += J.T @ r
        return A, b

    def jacobians(self, at: Unknowns) -> Iterator[tuple[Tensor, Tensor, Tensor, slice]]:
        """J [n, k] and r [n] of some residuals but those of the velocity, the numbers of the k
        unknowns, and which points they are: of the equations, then of the surface."""
        F = at.C.shape[1]
        every = torch.arange(5 * F + len(self.free), device=at.C.device)
        for row in self.rows(at):
            by_C = torch.einsum("cnk,cnf->nkf", row.by_z[..., row.used], row.h).flatten(1)
            i = torch.cat([every[: 5 * F].view(5, F)[row.used].flatten(), every[5 * F :]])
            yield torch.cat([by_C, row.by_theta], 1), row.residual, i, row.points

    def rows(self, at: Unknowns) -> Iterator[PointRow]:
        """Every residual of the equations and of the surface with its slopes, in chunks."""
        for r, h, z, theta, fields, points in self._rows(at):
            for column, used in zip(r.unbind(1), fields, strict=True):
                by_z, by_theta = torch.autograd.grad(
                    column.sum(), (z, theta), retain_graph=True, materialize_grads=True
                )
                yield PointRow(points, column.detach(), h, by_z, by_theta[:, self.free], used)

    def weigh_anew(self) -> None:
        """Take the weights of the law and its shares of the mean from the next evaluation."""
        self._kept = None

    def expect_smooth(self, A: Tensor, b: Tensor, at: Unknowns) -> float:
        """Add the prior of a curve to the normal equations and to the loss; its loss at `at`."""
        theta, D = at.theta[self.free], self.differences
        self.roughness = curve_prior.strength(A, b, self.scores(at), theta, D, RIDGE)
        own = slice(len(b) - len(theta), len(b))
        A[own, own] += self.roughness * D.T @ D
        b[own] += self.roughness * D.T @ (D @ theta)
        return self._rough(at)

    def _rough(self, at: Unknowns) -> float:
        """The loss of the prior of a curve, 0 for other laws."""
        return self.roughness * float((self.differences @ at.theta[self.free]).square().sum()) / 2

    def misfit(self, at: Unknowns) -> tuple[float, Tensor, Tensor]:
        """Twice the velocity part of the loss, its gradient [2, F], and the mean of h h^T."""
        h_h, v_h, v_v = self.data.moments
        U, C = self.physics.velocity_scale, self.factors * at.C[:2]
        square = ((C @ h_h) * C).sum() - 2 * (C * v_h).sum() / U + v_v.sum() / U**2
        slope = self.velocity_weight * self.factors * (C @ h_h - v_h / U)
        return self.velocity_weight * float(square), slope, h_h

    def _rows(self, at: Unknowns) -> Iterator[Rows]:
        first, every = 0, []
        for h in self.h:
            rows = slice(first, first + h.shape[1])
            first = rows.stop
            z, theta = self._leaves(at, h)
            source = None if self.data.source is None else self.data.source[rows]
            kept = None if self._kept is None else self._kept[rows]
            e, kept = residuals(z, theta, self.physics, self.law, source, kept)
            every.append(kept)
            one, w = torch.ones_like(kept[:, 0]), kept[:, 0]
            w = torch.stack([one, one, one, w, w], 1) * self._weights[rows]
            yield e * w, h, z, theta, DEPENDS, rows
        if self._kept is None:
            self._kept = torch.cat(every)
        if len(self.h_surface):
            z, theta = self._leaves(at, self.h_surface[None])
            p = self.physics.pressure_scale * torch.nn.functional.softplus(z[0, :, 2])
            r = (p - self.data.surface_pressure) * self._surface
            yield r[:, None], self.h_surface[None], z, theta, [[2]], slice(first, first + len(r))

    @staticmethod
    def _leaves(at: Unknowns, h: Tensor) -> tuple[Tensor, Tensor]:
        z, theta = h @ at.C.T, at.theta.expand(h.shape[1], -1).clone()
        return z.requires_grad_(torch.is_grad_enabled()), theta.requires_grad_(z.requires_grad)


def chunks(points: Tensor) -> list[slice]:
    """Slices of points that are evaluated together."""
    ends = [*range(0, len(points), CHUNK[points.device.type]), len(points)]
    return [slice(first, end) for first, end in pairwise(ends)]


def gram(J: Tensor) -> Tensor:
    """J^T J [K, K] of J [n, K]; the blocks above the diagonal are copies of those below it."""
    A = J.new_empty(J.shape[1], J.shape[1])
    ends = [J.shape[1] * k // BLOCKS for k in range(BLOCKS + 1)]
    for first, end in pairwise(ends):
        A[first:end, :end] = J[:, first:end].T @ J[:, :end]
        A[:first, first:end] = A[first:end, :first].T
    return A
