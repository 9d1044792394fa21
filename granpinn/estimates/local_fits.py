r"""Local least-squares fits to the cells of a grid: smooth values, their slopes, and the errors.

Around a cell, a polynomial of order 1 or 2 in (t, y, x) is fitted to the cells of a window, with
weights: 0 where a cell has no value. In a full window both orders have the same slopes; order 2 is
exact for quadratic fields beside gaps and edges, too, and order 1 needs fewer cells (Savitzky &
Golay, Anal. Chem. 36, 1964, for windows without gaps).

All windows are solved at once from moments, which are convolutions over cells of even spacing. With
independent errors, of variance 1/w in a cell of weight w, the coefficients have the covariance
$M^{-1}$ with the matrix $M$ of the moments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64, Index

AT_ONCE = 2**18  # moments of windows that are solved at a time
# A window must constrain its coefficients: smallest over largest eigenvalue of the scaled moments.
LEAST_RANK = {1: 0.02, 2: 0.001}


@dataclass(frozen=True, eq=False)
class LocalFits:
    """The fits of F fields around K cells.

    Attributes:
        index: (frame, row, column) of the cells, three arrays [K].
        value: [K, F].
        slopes: along t, y and x, 0 along an axis that is left out [K, 3, F].
        sd: standard deviations of the slopes for errors of 1 [K, 3].
        value_sd: that of the value [K].
    """

    index: tuple[Index, ...]
    value: Float64
    slopes: Float64
    sd: Float64
    value_sd: Float64

    def on_grid(self, values: Float64, shape: tuple[int, ...]) -> Float64:
        """Values of the cells [K] on the whole grid [T, Y, X], NaN elsewhere."""
        grid = np.full(shape, np.nan)
        grid[self.index] = values
        return grid


def local_fits(
    fields: Sequence[Float64],
    weight: Float64,
    spacing: tuple[float, float, float],
    half: tuple[int, int, int],
    order: int,
    frame: int | None = None,
    periodic: bool = False,
) -> LocalFits:
    """Fit polynomials around the cells whose windows constrain them.

    Args:
        fields: [T, Y, X] each; 0 where the weight is.
        weight: [T, Y, X].
        spacing: of the cells along t, y, x.
        half: cells on each side of the middle of a window, along t, y, x; 0 leaves an axis out.
        order: of the polynomial, 1 or 2.
        frame: the one around whose cells to fit; by default all.
        periodic: along x.
    """
    some = slice(None) if frame is None else slice(frame, frame + 1)
    index = np.nonzero(weight[some] > 0)
    # Offsets in units of the half-width, so that the moments are of one size.
    offsets = [np.arange(-h, h + 1) / max(h, 1) for h in half]
    axes = [axis for axis in range(3) if half[axis] > 0]

    def moment(values: Float64, powers: tuple[int, ...]) -> Float64:
        if frame is not None:
            near = np.arange(len(values)) - frame
            near = near[np.abs(near) <= half[0]]
            factors = offsets[0][near + half[0]] ** powers[0]
            values = np.tensordot(factors, values[near + frame], 1)[None]
        for axis in axes if frame is None else [axis for axis in axes if axis > 0]:
            mode = "wrap" if periodic and axis == 2 else "constant"
            values = scipy.ndimage.correlate1d(
                values, offsets[axis] ** powers[axis], axis=axis, mode=mode
            )
        return np.asarray(values[index])

    @cache
    def moment_of_weight(powers: tuple[int, ...]) -> Float64:
        return moment(weight, powers)

    basis = [p for n in range(order + 1) for p in _monomials(axes, n)]
    matrix = np.empty((index[0].size, len(basis), len(basis)))
    for i, j in combinations_with_replacement(range(len(basis)), 2):
        powers = tuple(a + b for a, b in zip(basis[i], basis[j], strict=True))
        matrix[:, i, j] = matrix[:, j, i] = moment_of_weight(powers)
    right = np.stack([[moment(f * weight, powers) for f in fields] for powers in basis])
    right = np.moveaxis(right, 2, 0)  # [K, basis, F]
    size = max(1, AT_ONCE // len(basis) ** 2)
    parts = [
        _solved(matrix[k : k + size], right[k : k + size], order)
        for k in range(0, max(len(matrix), 1), size)
    ]
    solvable, solution, sd = (np.concatenate(part) for part in zip(*parts, strict=True))
    slopes, of_slopes = np.zeros((len(solution), 3, len(fields))), np.zeros((len(solution), 3))
    for i, axis in enumerate(axes, 1):
        unit = half[axis] * spacing[axis]
        slopes[:, axis], of_slopes[:, axis] = solution[:, i] / unit, sd[:, i] / unit
    place = tuple(i[solvable] for i in index)
    place = (place[0] + (frame or 0), *place[1:])
    return LocalFits(place, solution[:, 0], slopes, of_slopes, sd[:, 0])


def _monomials(axes: Sequence[int], degree: int) -> list[tuple[int, ...]]:
    """The powers of (t, y, x) in the monomials of a degree in some axes."""
    chosen = combinations_with_replacement(axes, degree)
    return [tuple(factors.count(axis) for axis in range(3)) for factors in chosen]


def _solved(matrix: Float64, right: Float64, order: int) -> tuple[Bool, Float64, Float64]:
    """Which windows constrain their coefficients [K], and of those the coefficients [k, n, F] and
    their standard deviations for errors of 1 [k, n]."""
    eigenvalues = np.linalg.eigvalsh(matrix / np.maximum(matrix[:, :1, :1], 1.0))
    solvable = eigenvalues[:, 0] > LEAST_RANK[order] * eigenvalues[:, -1]
    solvable &= matrix[:, 0, 0] > matrix.shape[1]  # an exact fit shows no error
    inverse = np.linalg.inv(matrix[solvable])
    return solvable, inverse @ right[solvable], np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))


def quadratic_basis(offsets: Sequence[Float64]) -> Float64:
    """1, the offsets from the middle along every axis, and their products in pairs [..., n].

    Args:
        offsets: along one axis each, all of one shape [...].
    """
    products = [a * b for a, b in combinations_with_replacement(offsets, 2)]
    return np.stack([np.ones_like(offsets[0]), *offsets, *products], axis=-1)


def line_slopes(values: Float64, window: int, spacing: float) -> Float64:
    """Slopes of values on even lines without gaps, along the last axis; same shape.

    The fit of order 2 is over `window` values, an odd number; a short line has an odd one below its
    length. Towards an end the slope is that of the last window, away from its middle.
    """
    count = values.shape[-1]
    half = (min(window, count + count % 2 - 1)) // 2
    places = np.arange(-half, half + 1.0)
    _, slope, curvature = np.linalg.pinv(quadratic_basis([places])) / spacing
    found = scipy.ndimage.correlate1d(values, slope, axis=-1)
    towards_start = slope + 2 * places[:half, None] * curvature
    towards_end = slope + 2 * places[half + 1 :, None] * curvature
    found[..., :half] = values[..., : 2 * half + 1] @ towards_start.T
    found[..., count - half :] = values[..., count - 2 * half - 1 :] @ towards_end.T
    return np.asarray(found)
