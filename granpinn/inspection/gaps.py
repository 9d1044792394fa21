"""Gaps in fields [K, Y, X]: filled, or left out of means."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64


def nearest(values: Float64) -> Float64:
    """Gaps filled with the nearest value below, above, to the left, to the right; else 0."""
    filled = values
    for axis, order in ((1, 1), (1, -1), (2, 1), (2, -1)):
        n = filled.shape[axis]
        place = np.arange(n).reshape([n if a == axis else 1 for a in range(3)])
        lines = np.flip(filled, axis) if order < 0 else filled
        last = np.maximum.accumulate(np.where(np.isfinite(lines), place, 0), axis=axis)
        lines = np.take_along_axis(lines, last, axis)
        filled = np.flip(lines, axis) if order < 0 else lines
    return np.nan_to_num(filled)


def mean_along_x(values: Float64, there: Float64) -> Float64:
    """Means over the places where `there` is finite [..., 1]; NaN in rows that are mostly gaps."""
    weight = np.isfinite(there)
    total = np.where(weight, values, 0.0).sum(axis=2, keepdims=True)
    count = weight.sum(axis=2, keepdims=True)
    enough = count > weight.shape[2] // 2
    return np.asarray(np.where(enough, total / np.maximum(count, 1), np.nan))
