"""Smooth values and first derivatives of gridded fields by local quadratic fits.

Around every cell a polynomial of second order in (t, y, x) is fitted to the cells of a window, by
least squares with weights (0 where a cell has no value). The fit at the middle of the window is
exact for quadratic fields, also beside gaps and edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from granpinn.arrays import Float64

ENOUGH = 1.5  # cells in a window per coefficient; fewer give no value


@dataclass(frozen=True)
class Smooth:
    """Value and slopes [T, Y, X]; NaN where too few cells are near; t is 0 for a single frame."""

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
) -> list[Smooth]:
    """Local quadratic fits of several fields with the same weights.

    Args:
        fields: [T, Y, X] each; anything where the weight is 0.
        weight: [T, Y, X].
        spacing: of the cells along t, y, x.
        half: cells on each side of the middle of a window, along t, y, x; 0 leaves an axis out,
            and 1 is too few for a slope at the ends.
        periodic: along x.
    """
    filled = [np.where(weight > 0, f, 0.0) * weight for f in fields]
    pad = [(h, h) for h in half]
    padded = []
    for array in (weight, *filled):
        inner = np.pad(array, (*pad[:2], (0, 0)))
        padded.append(
            np.pad(inner, ((0, 0), (0, 0), pad[2]), mode="wrap" if periodic else "constant")
        )
    window = tuple(2 * h + 1 for h in half)
    views = [sliding_window_view(a, window) for a in padded]
    basis, axes = _basis(half)
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
    n = basis.shape[1]
    found = np.full((len(fields), n, *weight.shape), np.nan)
    for k in range(weight.shape[0]):
        w = views[0][k].reshape(-1, len(basis))
        normal = (w @ products).reshape(-1, n, n)
        enough = (w > 0).sum(axis=1) >= ENOUGH * n
        normal[~enough] = np.eye(n)
        normal = normal + 1e-9 * np.eye(n) * np.trace(normal, axis1=1, axis2=2)[:, None, None]
        right = np.stack([v[k].reshape(-1, len(basis)) @ basis for v in views[1:]], axis=2)
        solved = np.linalg.solve(normal, right)
        solved[~enough] = np.nan
        found[:, :, k] = solved.transpose(2, 1, 0).reshape(len(fields), n, *weight.shape[1:])
    made = []
    for f in found:
        slopes = [
            f[1 + axes.index(a)] / (half[a] * spacing[a]) if a in axes else 0 * f[0]
            for a in range(3)
        ]
        made.append(Smooth(f[0], *slopes))
    return made


def _basis(half: tuple[int, int, int]) -> tuple[Float64, list[int]]:
    """1, the used axes, and their products, at the cells of a window: [window, n]; the axes."""
    axes = [a for a in range(3) if half[a] > 0]
    grids = np.meshgrid(*(np.arange(-h, h + 1) / max(h, 1) for h in half), indexing="ij")
    used = [grids[a].ravel() for a in axes]
    terms = [np.ones(grids[0].size), *used]
    terms += [used[i] * used[j] for i in range(len(used)) for j in range(i, len(used))]
    return np.stack(terms, axis=1), axes
