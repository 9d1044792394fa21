"""Where the grains end: the free surface, and which cells are full.

The surface is the highest point of each column of cells at which the solid fraction falls through
half its bulk value, by linear interpolation between cell centres. It is known to half a grain: that
is how far the line moves if the fraction is a quarter or three quarters. A cell is full (c = 1) if
its fraction is above 0.9 of the bulk value and the line is at least 2 sd of the kernel away.
Cells between these and the line are partly filled: c = phi/phi_bulk, and their velocity is as real
as any other, since the mean weighs by mass.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from bench.studies.grains.coarse import SD, Fields
from granpinn.arrays import Float64

FULL = 0.9  # of the bulk fraction
KEPT = 0.25  # of the bulk fraction: a cell below it has no vector
AWAY = 2 * SD  # of a full cell from the line
UNCERTAINTY = 0.5  # of the line, d


def surface_height(fields: Fields, level: float = 0.5) -> Float64:
    """Height of the line in every column, [T, X]; NaN where there are no grains."""
    threshold = level * fields.bulk
    phi, y = fields.phi, fields.y
    above = phi > threshold
    above[:, -1] = False
    top = phi.shape[1] - 1 - np.argmax(above[:, ::-1], axis=1)  # last cell above the level
    top = np.minimum(top, phi.shape[1] - 2)
    low = np.take_along_axis(phi, top[:, None], axis=1)[:, 0]
    high = np.take_along_axis(phi, top[:, None] + 1, axis=1)[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        height = y[top] + (y[1] - y[0]) * (low - threshold) / (low - high)
    return np.asarray(np.where(above.any(axis=1), height, np.nan))


def fraction(fields: Fields, height: Float64 | None) -> Float64:
    """c of every cell, [T, Y, X]; `height` is that of the line, None without a free surface."""
    c = np.clip(fields.phi / fields.bulk, 0, 0.999)
    full = (fields.phi > FULL * fields.bulk) & np.isfinite(fields.u)
    if height is not None:
        full &= distance(fields, height) >= AWAY
        full &= fields.y[:, None] < height[:, None, :]
    c[full] = 1.0
    return np.asarray(np.where(fields.coverage > 0.3, c, 0.0))


def distance(fields: Fields, height: Float64) -> Float64:
    """Distance of every cell centre from the line, [T, Y, X]; infinite without grains."""
    found = np.full(fields.phi.shape, np.inf)
    at = np.stack(np.meshgrid(fields.y, fields.x, indexing="ij"), axis=-1)
    fine = np.arange(fields.x[0], fields.x[-1], 0.25)
    for k, line in enumerate(height):
        there = np.isfinite(line)
        if there.sum() > 1:
            dense = np.interp(fine, fields.x[there], line[there], left=np.nan, right=np.nan)
            points = np.stack([dense, fine], axis=1)[np.isfinite(dense)]
            found[k] = KDTree(points).query(at)[0]
    return found
