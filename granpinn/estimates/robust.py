"""Medians and signs of errors: estimates that a few bad vectors hardly change."""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Float64

FEWEST = 50  # values below which there is no estimate
NORMAL = 1.4826  # standard deviation over median absolute deviation of normal deviates
LEAST_CORRELATION = 0.05  # below this it is scatter


def spread(values: Float64) -> float | None:
    """Standard deviation of the finite ones of normal deviates around 0; None if they are few."""
    finite = values[np.isfinite(values)]
    if finite.size < FEWEST:
        return None
    return float(NORMAL * np.median(np.abs(finite)))


def correlation(products: Float64) -> float:
    """Of two normal deviates, from the signs of their products; 0 if these are few.

    The mean sign is 2/pi arcsin of the correlation.
    """
    known = products[np.isfinite(products) & (products != 0)]
    if known.size < FEWEST:
        return 0.0
    return math.sin(math.pi / 2 * float(np.mean(np.sign(known))))


def rms(u: float, v: float) -> float:
    """Root mean square of two components."""
    return math.sqrt((u * u + v * v) / 2)
