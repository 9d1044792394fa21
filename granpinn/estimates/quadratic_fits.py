"""Smooth values and first derivatives of gridded fields by local quadratic fits.

Around a cell, a polynomial of second order in (t, y, x) is fitted to the cells of a window, by
least squares with weights (0 where a cell has no value). The fit at the middle of the window is
exact for quadratic fields, also beside gaps and edges (Savitzky & Golay, Anal. Chem. 36, 1964, for
windows without gaps).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import correlate1d

from granpinn.arrays import Bool, Float64

ENOUGH = 1.5  # cells in a window per coefficient; fewer give no value
AT_ONCE = 8192  # windows that are copied at a time


@dataclass(frozen=True)
class Smooth:
    """Value and slopes [T, Y, X], NaN where there is no fit; t is 0 if the axis is left out."""

    value: Float64
    t: Float64
    y: Float64
    x: Float64


def smooth(
    fields: Sequence[Float64],
    weight: Float64,
    spacing: tuple[float, float, float],
    half: tuple[int, int, int],
    periodic: bool = False,
    at: Bool | None = None,
) -> list[Smooth]:
    """Local quadratic fits of several fields with the same weights.

    Args:
        fields: [T, Y, X] each; anything where the weight is 0.
        weight: [T, Y, X].
        spacing: of the cells along t, y, x.
        half: cells on each side of the middle of a window, along t, y, x; 0 leaves an axis out,
            and 1 gives no fit at the ends.
        periodic: along x.
        at: the cells [T, Y, X] around which to fit; by default all.
    """
    basis, axes = _basis(half)
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
    n = basis.shape[1]
    views = [_windows(a, half, periodic) for a in (weight, *(_filled(f, weight) for f in fields))]
    whole = np.linalg.pinv(basis)
    found = np.full((len(fields), n, *weight.shape), np.nan)
    places = np.argwhere(np.ones(weight.shape, bool) if at is None else at)
    for begin in range(0, len(places), AT_ONCE):
        here = tuple(places[begin : begin + AT_ONCE].T)
        w = views[0][here].reshape(-1, len(basis))
        right = np.stack([v[here].reshape(-1, len(basis)) for v in views[1:]], axis=2)
        solved = np.full((len(w), n, len(fields)), np.nan)
        full = (w == 1).all(axis=1)
        solved[full] = whole @ right[full]
        partly = ~full & ((w > 0).sum(axis=1) >= ENOUGH * n) & _spans(w, half)
        normal = (w[partly] @ products).reshape(-1, n, n)
        normal += 1e-9 * np.eye(n) * np.trace(normal, axis1=1, axis2=2)[:, None, None]
        solved[partly] = np.linalg.solve(normal, basis.T @ right[partly])
        found[(slice(None), slice(None), *here)] = solved.transpose(2, 1, 0)
    made = []
    for f in found:
        slopes = [
            f[1 + axes.index(a)] / (half[a] * spacing[a]) if a in axes else 0 * f[0]
            for a in range(3)
        ]
        made.append(Smooth(f[0], *slopes))
    return made


def quadratic_basis(offsets: Sequence[Float64]) -> Float64:
    """1, the offsets from the middle along every axis, and their products in pairs [..., n].

    Args:
        offsets: along one axis each, all of one shape [...].
    """
    products = [a * b for a, b in combinations_with_replacement(offsets, 2)]
    return np.stack([np.ones_like(offsets[0]), *offsets, *products], axis=-1)


def line_slopes(values: Float64, window: int, spacing: float) -> Float64:
    """Slopes of values on even lines without gaps, along the last axis; same shape.

    The fit is over `window` values, an odd number; a short line has an odd one below its length.
    Towards an end the slope is that of the last window, away from its middle.
    """
    count = values.shape[-1]
    half = (min(window, count + count % 2 - 1)) // 2
    places = np.arange(-half, half + 1.0)
    _, slope, curvature = np.linalg.pinv(quadratic_basis([places])) / spacing
    found = correlate1d(values, slope, axis=-1)
    towards_start = slope + 2 * places[:half, None] * curvature
    towards_end = slope + 2 * places[half + 1 :, None] * curvature
    found[..., :half] = values[..., : 2 * half + 1] @ towards_start.T
    found[..., count - half :] = values[..., count - 2 * half - 1 :] @ towards_end.T
    return np.asarray(found)


def noise_of(half: tuple[int, int, int], spacing: tuple[float, float, float]) -> Float64:
    """Standard deviations for independent errors of 1 in windows without gaps: [4].

    Of the slopes along t, y, x (0 for an axis that is left out), and of what the fit leaves of the
    cell in the middle (NaN if a window has too few cells to leave anything).
    """
    basis, axes = _basis(half)
    inverse = np.linalg.pinv(basis)
    row = np.sqrt((inverse**2).sum(axis=1))
    slopes = [
        row[1 + axes.index(a)] / (half[a] * spacing[a]) if a in axes else 0.0 for a in range(3)
    ]
    enough = len(basis) >= ENOUGH * basis.shape[1]
    rest = np.sqrt(1 - inverse[0, len(basis) // 2]) if enough else np.nan
    return np.array([*slopes, rest])


def _spans(weight: Float64, half: tuple[int, int, int]) -> Bool:
    """Windows [m] whose cells have three or more places along every axis."""
    there = (weight > 0).reshape(-1, *(2 * h + 1 for h in half))
    good = np.ones(len(there), bool)
    for axis, others in enumerate(((2, 3), (1, 3), (1, 2))):
        if half[axis] > 0:
            good &= there.any(axis=others).sum(axis=1) > 2
    return good


def _filled(field: Float64, weight: Float64) -> Float64:
    return np.asarray(np.where(weight > 0, field, 0.0) * weight)


def _windows(array: Float64, half: tuple[int, int, int], periodic: bool) -> Float64:
    """The window around every cell: [T, Y, X, 2 half_t + 1, 2 half_y + 1, 2 half_x + 1]."""
    pad = [(h, h) for h in half]
    inner = np.pad(array, (*pad[:2], (0, 0)))
    padded = np.pad(inner, ((0, 0), (0, 0), pad[2]), mode="wrap" if periodic else "constant")
    return sliding_window_view(padded, tuple(2 * h + 1 for h in half))


def _basis(half: tuple[int, int, int]) -> tuple[Float64, list[int]]:
    """The quadratic basis at the cells of a window [window, n], and the used axes."""
    axes = [a for a in range(3) if half[a] > 0]
    grids = np.meshgrid(*(np.arange(-h, h + 1) / max(h, 1) for h in half), indexing="ij")
    return quadratic_basis([grids[a].ravel() for a in axes]), axes
