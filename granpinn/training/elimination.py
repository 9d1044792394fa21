r"""The normal equations of a last layer: their matrix, and their solution with a ridge.

Members f that have one law $\theta$ have each its own last layer $C_f$. Each eliminates it,

$$ S_f = A_{\theta\theta} - A_{\theta C} A_{CC}^{-1} A_{C\theta}, \quad
   g_f = b_\theta - A_{\theta C} A_{CC}^{-1} b_C , $$

and the sums give the step of the law, $\delta = -(\sum_f S_f)^{-1} \sum_f g_f$, and with it that of
every $C_f$.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor

RIDGE = 1e-7  # on the coefficients, as a part of the diagonal of the normal equations

BLOCKS = 4  # of columns in `gram`


def gram(J: Tensor) -> Tensor:
    """J^T J [K, K] of J [n, K]; the blocks above the diagonal are copies of those below it."""
    A = J.new_empty(J.shape[1], J.shape[1])
    ends = [J.shape[1] * k // BLOCKS for k in range(BLOCKS + 1)]
    for first, end in pairwise(ends):
        A[first:end, :end] = J[:, first:end].T @ J[:, :end]
        A[:first, first:end] = A[first:end, :first].T
    return A


def solve(A: Tensor, b: Tensor, L: int, ridge: float = RIDGE) -> Tensor | None:
    """The step [K] of the normal equations; None where they are not positive definite.

    Args:
        L: number of parameters of the law, the last ones of the K unknowns.
        ridge: added to the unit diagonal of the scaled equations for C. The hidden units are nearly
            dependent; the ridge keeps the step small in directions that no data determine.
    """
    found = factor(A, L, ridge)
    if found is None:
        return None
    return -torch.cholesky_solve((b / found.scale)[:, None], found.factor)[:, 0] / found.scale


def solve_group(
    equations: Sequence[tuple[Tensor, Tensor]], L: int, ridge: float = RIDGE
) -> list[Tensor] | None:
    """The steps [K] of members that have one law; None where they are not positive definite.

    Args:
        equations: A [K, K] and b [K] of each member.
        L, ridge: as for `solve`.
    """
    if len(equations) == 1:
        x = solve(*equations[0], L, ridge)
        return None if x is None else [x]
    eliminated = []
    for A, b in equations:
        found = factor(A[:-L, :-L], 0, ridge)
        if found is None:
            return None
        sides = torch.cat([b[:-L, None], A[:-L, -L:]], 1) / found.scale[:, None]
        eliminated.append(torch.cholesky_solve(sides, found.factor) / found.scale[:, None])
    reduced = [
        torch.cat([b[-L:, None], A[-L:, -L:]], 1) - A[-L:, :-L] @ X
        for (A, b), X in zip(equations, eliminated, strict=True)
    ]
    both = torch.stack(reduced).sum(0)
    triangle, fault = torch.linalg.cholesky_ex(both[:, 1:])
    if int(fault):
        return None
    by_law = -torch.cholesky_solve(both[:, :1], triangle)[:, 0]
    return [torch.cat([-X[:, 0] - X[:, 1:] @ by_law, by_law]) for X in eliminated]


class Factor(NamedTuple):
    """A = scale factor factor^T scale, with the ridge: the scale [K] and a triangle [K, K]."""

    scale: Tensor
    factor: Tensor


def factor(A: Tensor, L: int, ridge: float = RIDGE) -> Factor | None:
    """The factors of normal equations; None where they are not positive definite. As `solve`."""
    scale = A.diagonal().sqrt().clamp_min(1e-30)
    scaled = A / scale / scale[:, None]
    scaled.diagonal()[: len(A) - L] += ridge
    triangle, fault = torch.linalg.cholesky_ex(scaled)
    return None if int(fault) else Factor(scale, triangle)
