r"""What the data tell of a friction law: the loss around a trained network.

The outputs of the last hidden layer are given functions, as in the last-layer step
(`last_layer.py`). The coefficients C of the network are eliminated: for every law they take their
best values. So the loss is a function of the law alone. It is quadratic, and a sum over the points,

$$ L(\theta + \delta) = L_0 + \sum_B \left( s_B^T \delta + \tfrac12 \delta^T H_B \delta \right),
   \quad s_B = \sum_{i \in B} \tilde J_i^T r_i, \ H_B = \sum_{i \in B} \tilde J_i^T \tilde J_i, $$

over boxes B in space and time. With $J = (J_C, J_\theta)$ the derivatives of a residual,
$\tilde J = J_\theta - J_C A_{CC}^{-1} A_{C\theta}$, A = J^T J. The residuals r are those with the
best C at theta.

Everything is dimensionless and float64.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from granpinn.physics.laws import free
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer import factor
from granpinn.training.last_layer_sums import RIDGE, Boxes, PointRow, Sums, Unknowns, choose
from granpinn.training.objective import Member

BOXES = 8  # along each axis


@dataclass(frozen=True)
class Information:
    """The quadratic loss around a law of L free parameters.

    Attributes:
        free: those that are not fixed [L].
        scores: s of every box [B, L]; B = BOXES^3, x slowest, then y, then time.
        information: H of every box [B, L, L].
        prior: curvature of the prior of a curve [L, L], of no box.
    """

    free: Tensor
    scores: Tensor
    information: Tensor
    prior: Tensor


def information(member: Member, params: Tensor, theta: Tensor, step: int) -> Information | None:
    """The loss around a trained network, by its law; None: the data determine nothing.

    A free curve gets a cohesion of 0 beside its coefficients.

    Args:
        member, params, theta, step: as for `last_layer.last_layer`, after that step.
    """
    features = Features(member.problem.spec, params, member.problem.window)
    points = choose(member.data, features, member.seed, step)
    theta, law = theta.double(), member.law
    if law is free.LAW:
        law, theta = free.WITH_COHESION, torch.cat([theta, theta.new_zeros(1)])
    sums = Sums(features, member.problem, law, points)
    at = Unknowns(coefficients(member.problem.spec, params), theta)
    sums.loss(at)  # fixes the weights of the law
    with torch.enable_grad():
        A, b = sums.normal_equations(at)
        L = len(sums.free)
        found = factor(A[:-L, :-L], 0, RIDGE)
        if found is None:
            return None
        X = found.solve(-torch.cat([b[:-L, None], A[:-L, -L:]], 1))
        boxes = Boxes(member.data.lower, member.data.upper, BOXES)
        scores, squares = X.new_zeros(boxes.total, L), X.new_zeros(boxes.total, L, L)

        def add(where: Tensor, r: Tensor, J: Tensor) -> None:
            box = boxes.number(where)
            scores.index_add_(0, box, J * r[:, None])
            squares.index_add_(0, box, J[:, :, None] * J[:, None])

        where = torch.cat([points.points, points.surface_points])
        for row in sums.rows(at):
            moved = _along(row, X, at.C.shape[1])
            add(where[row.points], row.residual + moved[:, 0], row.by_theta + moved[:, 1:])
        _add_vectors(sums, at, X, add)
        D, roughness = sums.differences, 0.0
        if len(D):
            sums.expect_smooth(A, b, at)
            roughness = sums.roughness
    return Information(theta[sums.free], scores, squares, roughness * D.T @ D)


def _along(row: PointRow, X: Tensor, F: int) -> Tensor:
    """The change of a row along directions X [5 F, m] of the coefficients: [n, m]."""
    parts = [
        torch.einsum("cn,cnm->nm", row.by_z[..., c], row.h @ X[c * F : (c + 1) * F])
        for c in row.used
    ]
    return torch.stack(parts).sum(0)


def _add_vectors(sums: Sums, at: Unknowns, X: Tensor, add: Callable[..., None]) -> None:
    """The part of the measured velocity."""
    F, points = at.C.shape[1], sums.data.measured[0]
    for rows, h, e, weight in sums.vectors(at):
        root = weight.sqrt()
        for k in (0, 1):
            moved = root * sums.factors[k] * (h @ X[k * F : (k + 1) * F])
            add(points[rows], root[:, 0] * e[:, k] + moved[:, 0], moved[:, 1:])
