"""Synthetic measurement noise: additive, white, Gaussian, and a pure function of the seed.

Its standard deviation is given relative to the largest speed of the grains (for the velocity)
and to the largest |p| on the free surface (for the pressure there). The paper speaks of noise
"with a mean value equal to the percentage of the maximum velocity"; a Gaussian with that mean
would be an offset, so the percentage is taken as the standard deviation.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from granpinn.arrays import Float32, Float64, Floats
from granpinn.data.flow import Flow
from granpinn.data.particles import grid_view
from granpinn.declared import checked

_STREAM_U, _STREAM_V, _STREAM_P = range(3)


@checked
def add_noise(flow: Flow, sd: float, seed: int) -> Flow:
    """The flow with noise on u, v and the surface pressure, and with sigma_u, sigma_v to match.

    The noise of a vector does not depend on missing vectors elsewhere.

    Args:
        sd: standard deviation relative to the largest speed over the grains; 0 = no noise. A mean
            over frames gets the noise of such a mean.
        seed: 0 to 2**64 - 1.
    """
    if not (math.isfinite(sd) and sd >= 0):
        raise ValueError(f"sd of the noise must be a finite number >= 0, got {sd}")
    if not 0 <= seed < 2**64:
        raise ValueError(f"seed of the noise must be from 0 to 2**64 - 1, got {seed}")
    if sd == 0:
        return flow
    sigma = sd * max_speed(flow) / math.sqrt(flow.averaged)
    vectors = flow.particles or flow
    changes: dict[str, Any] = {
        "u": _noisy(vectors.u, sigma, seed, _STREAM_U),
        "v": _noisy(vectors.v, sigma, seed, _STREAM_V),
    }
    # Of particles without sigmas of their own, the flow has the sigmas.
    stated = flow if vectors.sigma_u is None or vectors.sigma_v is None else vectors
    sigmas: dict[str, Any] = {
        name: _in_quadrature(getattr(stated, name), sigma) for name in ("sigma_u", "sigma_v")
    }
    if stated is vectors:
        changes, sigmas = changes | sigmas, {}
    if flow.particles is not None:
        particles = replace(flow.particles, **changes)
        changes = grid_view(particles) | {"particles": particles}
    changes |= sigmas
    surface = flow.surface
    if surface is not None and surface.p is not None:
        largest = sd * float(np.abs(surface.p).max())
        surface = replace(surface, p=_noisy(surface.p, largest, seed, _STREAM_P))
    return replace(flow, surface=surface, **changes)


def known_sd(flow: Flow) -> float:
    """Rms standard deviation of one velocity component, in the units of the file; 0: unknown."""
    squares = []
    for sigma in stated_sigmas(flow):
        values = np.asarray(sigma, dtype=np.float64)
        if flow.particles is None and values.ndim:
            values = values[flow.valid]
        squares.append(float(np.mean(np.square(values))))
    return math.sqrt(sum(squares) / 2)


def stated_sigmas(flow: Flow) -> tuple[Any, Any]:
    """sigma_u and sigma_v of the measured vectors, numbers or arrays; 0: unknown."""
    holders = flow.particles or flow, flow
    pairs = ([getattr(holder, name) for holder in holders] for name in ("sigma_u", "sigma_v"))
    sigma_u, sigma_v = (next((s for s in pair if s is not None), 0.0) for pair in pairs)
    return sigma_u, sigma_v


def velocity_weights(variances: Float64) -> Float64:
    r"""Weights of vectors [n] with mean 1, from the variances of their measurement [n].

    $w_i \propto 1/(\sigma_i^2 + m)$ with the median m of all $\sigma_i^2$. It stands for the
    velocity that the network cannot resolve, which is the same for all vectors. With
    $1/\sigma_i^2$ the grains at rest would have nearly all the weight (bench/studies/film).
    """
    found = 1 / (variances + np.median(variances))
    return np.asarray(found / found.mean())


def max_speed(flow: Flow) -> float:
    """The largest speed over the grains, in the units of the file."""
    if flow.particles is not None:
        return float(np.hypot(flow.particles.u, flow.particles.v, dtype=np.float64).max())
    valid = flow.valid
    return float(np.hypot(flow.u[valid], flow.v[valid], dtype=np.float64).max())


def _noisy(values: Floats, sigma: float, seed: int, stream: int) -> Float32:
    """values + sigma * normal deviates; NaN stays NaN. One stream per array, in (t, y, x) order."""
    # Philox has a key of 128 bits: the seed is its low half, the stream its high half.
    generator = np.random.Generator(np.random.Philox(key=seed + (stream << 64)))
    noisy = values.astype(np.float64)
    noisy += sigma * generator.standard_normal(values.shape)
    result: Float32 = noisy.astype(np.float32)
    return result


def _in_quadrature(known: Any, added: float) -> float | Float32:
    """Standard deviation of the sum of two independent errors."""
    if known is None:
        return added
    if isinstance(known, np.ndarray):
        return np.hypot(known.astype(np.float64), added).astype(np.float32)
    return math.hypot(known, added)
