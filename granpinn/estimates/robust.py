"""Medians and signs of errors: estimates that a few bad vectors hardly change."""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Float64, Int8

FEWEST = 50  # values below which there is no estimate
NORMAL = 1.4826  # standard deviation over median absolute deviation of normal deviates
LEAST_CORRELATION = 0.05  # below this it is scatter


def robust_sd(values: Float64) -> float | None:
    """Standard deviation of the finite ones of normal deviates around 0; None if they are few."""
    finite = values[np.isfinite(values)]
    if finite.size < FEWEST:
        return None
    return float(NORMAL * np.median(np.abs(finite)))


def signs_of(values: Float64) -> Int8:
    """-1, 0 or 1 for each value; 0 for NaN."""
    return (values > 0).view(np.int8) - (values < 0).view(np.int8)


def correlation(signs: Int8) -> float:
    """Of two normal deviates, from the products of their signs; 0 if too few are not 0.

    The mean sign is 2/pi arcsin of the correlation.
    """
    known = int(np.count_nonzero(signs))
    if known < FEWEST:
        return 0.0
    mean = int(signs.sum(dtype=np.int64)) / known
    return math.sin(math.pi / 2 * mean)
