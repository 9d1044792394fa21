"""Solve the normal equations of a last layer, with a ridge on its coefficients."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

RIDGE = 1e-7  # on the coefficients, as a part of the diagonal of the normal equations


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
