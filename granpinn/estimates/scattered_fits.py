"""Noise and shear rate of scattered vectors, by local parabolas in x and y.

A parabola is fitted to each of some vectors and its nearest neighbors in the same frame. What it
leaves is the noise. The random motion of grains about the mean flow counts as noise. What neighbors
share is no part of it: noise.py shows that, where there are frames enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Float64
from granpinn.data.flow import Particles
from granpinn.estimates.gradients import shear_rate
from granpinn.estimates.noise import Noise
from granpinn.estimates.quadratic_fits import quadratic_basis
from granpinn.physics.scales import Scales

NEIGHBORS = 24
SAMPLES = 4000
CHI2_MEDIAN = 2 / 9  # the median of chi^2/n is (1 - CHI2_MEDIAN/n)^3 to 1 % from n = 6 on


def particle_vectors(particles: Particles, scales: Scales) -> tuple[Float64, ...]:
    """t, x, y, u, v of scattered vectors, dimensionless, [N] each."""
    points = scales.points_to_dimensionless(particles.x, particles.y, particles.t)
    velocity = [a.astype(np.float64) for a in (particles.u, particles.v)]
    u, v = (scales.to_dimensionless(a, "velocity") for a in velocity)
    return points[:, 2], points[:, 0], points[:, 1], u, v


@dataclass(frozen=True, eq=False)
class ParticleFits:
    """Local parabolas among scattered vectors, dimensionless.

    Attributes:
        noise: the noise of a typical vector.
        shear_rate: at each of the sampled vectors, less the part of the noise [S].
    """

    noise: Noise
    shear_rate: Float64


def particle_fits(t: Float64, x: Float64, y: Float64, u: Float64, v: Float64) -> ParticleFits:
    """Noise and shear rate of scattered vectors, dimensionless, all [N]."""
    from scipy.spatial import cKDTree

    found, rates = [], []
    _, size = np.unique(t, return_counts=True)
    order = np.argsort(t, kind="stable")
    starts = np.concatenate([[0], np.cumsum(size)])
    usable = np.flatnonzero(size > NEIGHBORS)
    # Frames spread over the times; within each, vectors spread over their order.
    picked = (
        usable[np.unique(np.linspace(0, usable.size - 1, 40).astype(int))] if usable.size else []
    )
    for k in picked:
        members = order[starts[k] : starts[k + 1]]
        points = np.stack([x[members], y[members]], axis=-1)
        stride = max(1, members.size * len(picked) // SAMPLES)
        centers = np.arange(0, members.size, stride)
        distance, near = cKDTree(points).query(points[centers], k=NEIGHBORS)
        reach = np.maximum(distance[:, -1], np.finfo(float).tiny)
        offset = (points[near] - points[centers][:, None]) / reach[:, None, None]
        variance, rate = _local_parabolas(offset, np.stack([u, v], -1)[members][near], reach)
        found.append(variance)
        rates.append(rate)
    if not found:
        unknown = Noise(None, None, None, 1.0)
        return ParticleFits(unknown, np.empty(0))
    variance = np.concatenate(found)
    typical = np.sqrt(np.median(variance, axis=0))
    noise = Noise(
        sigma=float(np.sqrt(np.mean(typical**2))),
        u=float(typical[0]),
        v=float(typical[1]),
        vectors_per_independent=1.0,
    )
    return ParticleFits(noise, np.concatenate(rates))


def _local_parabolas(offset: Float64, velocity: Float64, reach: Float64) -> tuple[Float64, Float64]:
    """Variance about local parabolas [S, 2], scaled to a median of the noise; shear rate [S].

    Args:
        offset: of the neighbors [S, k, 2], in units of the farthest.
        velocity: of the neighbors [S, k, 2].
        reach: distance of the farthest [S].
    """
    basis = quadratic_basis([offset[..., 0], offset[..., 1]])
    left, size, right = np.linalg.svd(basis, full_matrices=False)
    used = size > 1e-8 * size[:, :1]
    left = left * used[:, None, :]
    in_basis = np.swapaxes(left, 1, 2) @ velocity
    fitted = left @ in_basis
    freedom = basis.shape[1] - basis.shape[2]
    median = (1 - CHI2_MEDIAN / freedom) ** 3
    variance: Float64 = np.sum((velocity - fitted) ** 2, axis=1) / (freedom * median)
    inverse = np.swapaxes(right, 1, 2) * np.where(used, 1 / np.where(used, size, 1), 0)[:, None, :]
    slopes = (inverse @ in_basis)[:, 1:3] / reach[:, None, None]  # along x and y, of u and v
    of_noise = np.square(inverse[:, 1:3]).sum(axis=(1, 2)) / reach**2 * variance.sum(axis=1)
    (u_x, v_x), (u_y, v_y) = slopes.transpose(1, 2, 0)
    return variance, shear_rate(u_x, u_y, v_x, v_y, of_noise)
