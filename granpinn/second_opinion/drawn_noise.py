"""Noise like that of a measured flow, for simulated flows; a pure function of the seed.

The noise of a flow is estimated from its vectors (estimates/noise.py). A flow without noise shows
a little too, as it changes between frames. So the noise that is added has the variance by which the
measured flow exceeds the simulated one, for each component.

If neighboring vectors share errors, the noise is white noise in every frame that was averaged with
a Gaussian kernel k. Its correlations sum to

$$ \\sum_{a,b} \\rho_{ab} = \\Big( \\sum_i k_i \\Big)^4 \\Big/ \\Big( \\sum_i k_i^2 \\Big)^2 , $$

the number of vectors per independent one. The width of the kernel follows from the measured number;
it is the same along x and y. At scattered places the noise is white.

Where the file states a standard deviation for every vector, the noise varies in proportion to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy  # loads scipy.optimize at its first use
from scipy.ndimage import convolve1d

from granpinn.arrays import Float64, Floats
from granpinn.data import Flow
from granpinn.data.noise import stated_sigmas
from granpinn.data.particles import grid_view
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts

WIDEST = 50.0  # of the kernel, in cells: more vectors per independent one than can be measured


@dataclass(frozen=True)
class DrawnNoise:
    """The noise that is added to the vectors of a simulated flow.

    Attributes:
        sd: of u and v of a typical vector, in the units of the file.
        percent: rms of both, relative to the rms speed of the measured flow.
        vectors_per_independent: 1 for white noise.
        left_out: the measured number, where the noise is white all the same; else None.
    """

    sd: tuple[float, float]
    percent: float
    vectors_per_independent: float = 1.0
    left_out: float | None = None


def noise_of(measured: Flow, simulated: Flow) -> DrawnNoise:
    """The noise that a simulated flow lacks to be like the measured one."""
    scales = scales_of(measured)
    facts, own = Facts(measured, scales), Facts(simulated, scales)
    found, known = facts.noise, own.noise
    if found.u is None or found.v is None:  # too few vectors: the stated noise
        sd = _typical(measured)
    else:
        sd = (
            scales.velocity * _excess(found.u, known.u),
            scales.velocity * _excess(found.v, known.v),
        )
    size = math.hypot(*sd) / math.sqrt(2)
    shared = found.vectors_per_independent if size else 1.0
    white = measured.particles is not None
    return DrawnNoise(
        sd=sd,
        percent=100 * size / (facts.speed * scales.velocity),
        vectors_per_independent=1.0 if white else shared,
        left_out=shared if white and shared > 1 else None,
    )


def with_noise(flow: Flow, noise: DrawnNoise, seed: int) -> Flow:
    """The flow with a draw of the noise on its vectors.

    Args:
        seed: 0 to 2**64 - 1.
    """
    if not any(noise.sd):
        return flow
    vectors: Any = flow if flow.particles is None else flow.particles
    random = np.random.Generator(np.random.Philox(key=seed))
    kernel = kernel_of(noise.vectors_per_independent)
    u, v = (
        (field + sd * share * _draw(random, field, kernel)).astype(np.float32)
        for field, sd, share in zip((vectors.u, vectors.v), noise.sd, _shares(flow), strict=True)
    )
    vectors = replace(vectors, u=u, v=v)
    if flow.particles is None:
        return replace(flow, u=u, v=v)
    return replace(flow, **grid_view(vectors), particles=vectors)


def kernel_of(vectors_per_independent: float) -> Float64:
    """The Gaussian kernel along an axis [n], with the sum of squares 1; [1] for white noise."""
    wanted = math.sqrt(vectors_per_independent)
    if wanted <= 1:
        return np.ones(1)

    def gaussian(width: float) -> Float64:
        reach = math.ceil(5 * width)
        k = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
        return np.asarray(k / math.sqrt(float(np.square(k).sum())))

    def excess(width: float) -> float:
        return float(gaussian(width).sum()) ** 2 - wanted

    return gaussian(scipy.optimize.brentq(excess, 1e-2, WIDEST))


def _draw(random: np.random.Generator, field: Floats, kernel: Float64) -> Float64:
    """Deviates of unit variance like a field [T, Y, X] or [n]."""
    deviates = random.standard_normal(field.shape)
    for axis in (1, 2) if kernel.size > 1 else ():
        deviates = convolve1d(deviates, kernel, axis=axis, mode="wrap")
    return deviates


def _typical(flow: Flow) -> tuple[float, float]:
    """The median of the stated standard deviations of u and of v; 0: unknown."""

    def median(sigma: Any) -> float:
        values = np.asarray(sigma, np.float64)
        of_vectors = values[flow.valid] if values.shape == flow.u.shape else values
        return float(np.median(of_vectors))

    sigma_u, sigma_v = stated_sigmas(flow)
    return median(sigma_u), median(sigma_v)


def _shares(flow: Flow) -> list[Any]:
    """Stated standard deviations over the typical one; 1 where the file states one for all."""
    pairs = zip(stated_sigmas(flow), _typical(flow), strict=True)
    return [sigma / typical if np.ndim(sigma) else 1.0 for sigma, typical in pairs]


def _excess(measured: float, own: float | None) -> float:
    """Standard deviation of what a measured noise has more than another one."""
    return math.sqrt(max(measured**2 - (own or 0.0) ** 2, 0.0))
