r"""The error of a free curve mu(I) that was trained.

Its coefficients c come from a training. Their covariance is

$$ C = V + D, \qquad V = H^{-1} \Big( \sum_B s_B s_B^T \Big) H^{-1}: $$

V holds the residuals, with the scores s_B of boxes in space and time that count as independent (the
sandwich of White, Econometrica 48, 1980). Boxes of several sizes are tried; the largest V counts. D
is the further error of simulated flows with known laws, that of mu(I) at both ends of the range of
I times a factor, and the departure of real grains (error_model.py); between the ends the error of
log mu is linear in log I.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.physics.laws import free
from granpinn.training.information import BOXES, Information

SHAPES = ((4, 4, 8), (2, 2, 4), (4, 4, 4), (8, 8, 8))  # boxes along x, y and t


class Quadratic(NamedTuple):
    """The least loss of a law: its L free parameters, and their covariance V [L, L]."""

    center: Float64
    covariance: Float64


def quadratic(found: Information, L: int) -> Quadratic | None:
    """The least loss in the first L free parameters; None where the data do not determine them.

    The trained parameters are taken as the least: one more step of Gauss and Newton from there
    would follow the noise of the training.
    """
    scores = found.scores[:, :L].cpu().numpy()
    information = found.information[:, :L, :L].cpu().numpy()
    center = found.free[:L].cpu().numpy()
    H = information.sum(0) + found.prior[:L, :L].cpu().numpy()
    H += 1e-12 * np.trace(H) * np.eye(L)
    if not (np.isfinite(H).all() and np.isfinite(scores).all() and np.linalg.eigvalsh(H)[0] > 0):
        return None
    scores = scores - information @ np.linalg.solve(H, scores.sum(0))
    covariance, largest = np.zeros((L, L)), 0.0
    for shape in SHAPES:
        influence = np.linalg.solve(H, joined(scores, shape).T)
        V = influence @ influence.T
        size = float(np.trace(H @ V))
        if size > largest:
            covariance, largest = V, size
    return Quadratic(center, covariance) if largest > 0 else None


def joined(values: Float64, shape: tuple[int, int, int]) -> Float64:
    """Sums [B, L] over larger boxes, of the values of all boxes [BOXES^3, L]."""
    a, b, c = (BOXES // n for n in shape)
    cube = values.reshape(shape[0], a, shape[1], b, shape[2], c, -1)
    return np.asarray(cube.sum((1, 3, 5)).reshape(np.prod(shape), -1))


def basis(I: Float64, I_low: float, I_high: float) -> Float64:
    """mu of each coefficient at every I [n, N]."""
    columns = [free.friction(I, *row, I_low, I_high) for row in np.eye(free.COEFFICIENTS)]
    return np.stack(columns, axis=1)


def model_covariance(
    I: Float64,
    mu: Float64,
    I_range: tuple[float, float],
    of_ends: Float64,
) -> Float64:
    """D at every I [n, n], beyond the residuals.

    Args:
        mu: friction there [n].
        I_range: of the flow, 5th and 95th percentile.
        of_ends: covariance of log mu at both ends of that range [2, 2].
    """
    J = mu[:, None] * between(I, I_range)
    return np.asarray(J @ of_ends @ J.T)


def between(I: Sequence[float] | Float64, I_range: tuple[float, float]) -> Float64:
    """Errors of log mu at I by those at both ends of a range, linear in log I [n, 2]."""
    low, high = np.log(I_range)
    part = np.clip((np.log(I) - low) / (high - low), 0, 1)
    return np.stack([1 - part, part], axis=1)


@dataclass(frozen=True)
class CurveBand:
    """The free curve over the range of I of a flow.

    Attributes:
        I, mu: inertial numbers and friction [n].
        half: half-width of the band that holds 90 % [n].
        farthest: the same for 95 % [n].
    """

    I: Float64
    mu: Float64
    half: Float64
    farthest: Float64
