"""The normal equations of a last layer: their matrix, and their solution with a ridge."""

from __future__ import annotations

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
