"""Planes through the neighbors of every place of a map of heights.

A height that was read off a grid is known to its spacing. Where the surface is smooth, a plane
through the heights of a few frames and columns is several times as exact.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from granpinn.arrays import Float64, Index

RADII = (2, 1)  # of the windows, in frames and columns; the larger one first
LEAST = 0.5  # of the places of a window that must have a height
LARGEST = 0.75  # residual of a plane, in spacings: half for the grid, the rest for curvature
_ROUNDING = 1 + 1e-6  # on the limit, which residuals of a grid often meet exactly
_RIDGE = 1e-9  # a window of one frame, or of one column, leaves a slope of 0


def smoothed(heights: Float64, spacing: Float64) -> tuple[Float64, Float64]:
    """Heights on local planes, and the slopes of these planes per column; NaN: no plane.

    The plane of a place is the least squares fit to the heights of a window around it. It must miss
    none of them by more than `LARGEST` spacings; where the map is rougher, by more than the median
    of the places does. Steps have none. A map whose heights all lack neighbors stays as it is.

    Args:
        heights: one for every frame and column [T, X]; NaN: none.
        spacing: of the grid at every height, positive [T, X].
    """
    planes = [_planes(heights, radius) for radius in RADII]
    misses = np.min([farthest / spacing for _, _, farthest in planes], axis=0)
    misses = misses[np.isfinite(misses)]
    if not misses.size:
        return heights.copy(), np.where(np.isfinite(heights), 0.0, np.nan)
    most = max(LARGEST, float(np.median(misses)))
    found, slope = np.full_like(heights, np.nan), np.full_like(heights, np.nan)
    for height, rise, farthest in planes:
        near = np.isnan(found) & (farthest <= most * _ROUNDING * spacing)
        found[near], slope[near] = height[near], rise[near]
    return found, slope


def _planes(heights: Float64, radius: int) -> tuple[Float64, Float64, Float64]:
    """Height and slope of the plane of every place, and its largest residual; infinite: none."""
    moments, right = np.zeros((*heights.shape, 3, 3)), np.zeros((*heights.shape, 3))
    for place, rise in _neighbors(heights, radius):
        seen = np.isfinite(rise)
        moments += seen[..., None, None] * np.outer(place, place)
        right += np.where(seen, rise, 0.0)[..., None] * place
    plane = np.asarray(np.linalg.solve(moments + _RIDGE * np.eye(3), right[..., None]))[..., 0]
    farthest = np.zeros(heights.shape)
    for place, rise in _neighbors(heights, radius):
        np.fmax(farthest, np.abs(rise - plane @ place), out=farthest)
    whole = np.multiply.outer(*(_within(size, radius) for size in heights.shape))
    farthest[moments[..., 0, 0] < np.maximum(1, LEAST * whole)] = np.inf
    return heights + plane[..., 0], plane[..., 2], farthest


def _within(size: int, radius: int) -> Index:
    """The number of places within a radius of each of `size` places in a line [size]."""
    i = np.arange(size)
    return np.asarray(np.minimum(i + radius, size - 1) - np.maximum(i - radius, 0) + 1)


def _neighbors(heights: Float64, radius: int) -> Iterator[tuple[Float64, Float64]]:
    """Places (1, frames, columns) in a window, and how much higher each place has its neighbor.

    NaN: one of both has no height, or the neighbor lies beyond the edges of the map.
    """
    T, X = heights.shape
    padded = np.pad(heights, radius, constant_values=np.nan)
    for i, j in product(range(2 * radius + 1), repeat=2):
        rise = padded[i : i + T, j : j + X] - heights
        yield np.array([1.0, i - radius, j - radius]), rise
