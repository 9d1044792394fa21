"""Which grid points the pixels of the film show: the nearest ones."""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Floats, Int64
from granpinn.figures.style import NothingToDraw
from granpinn.results import Fields


def grain_box(fields: Fields) -> tuple[slice, slice]:
    """The rows and columns that hold grains at any time."""
    if fields.index.size == 0:
        raise NothingToDraw("fields.h5 has no grid point inside the grains")
    place = fields.index % (fields.y.size * fields.x.size)
    row, column = np.divmod(place, fields.x.size)
    return (
        slice(int(row.min()), int(row.max()) + 1),
        slice(int(column.min()), int(column.max()) + 1),
    )


def pixel_grid(y: Floats, x: Floats, pixels: int) -> tuple[Int64, Int64]:
    """Nearest grid rows [H] and columns [W] of square pixels; the longer side has <= `pixels`.

    Pixels are as fine as the finest grid spacing as long as they fit.
    """
    spacings = np.concatenate([np.diff(y), np.diff(x), [np.inf]])
    longest = max(np.ptp(y), np.ptp(x))
    side = max(float(spacings.min()), float(longest) / pixels)
    return _nearest(y, side, pixels), _nearest(x, side, pixels)


def _nearest(axis: Floats, side: float, pixels: int) -> Int64:
    if axis.size == 1:
        return np.zeros(1, np.int64)
    count = min(pixels, max(1, round(float(np.ptp(axis)) / side) + 1))
    centers = np.linspace(axis[0], axis[-1], count)
    return nearest_index(axis, centers)


def nearest_index(axis: Floats, wanted: Floats) -> Int64:
    """Index [n] of the value of an ascending axis that is nearest to each of `wanted` [n]."""
    middles = (axis[1:] + axis[:-1]) / 2
    return np.asarray(np.searchsorted(middles, wanted), np.int64)
