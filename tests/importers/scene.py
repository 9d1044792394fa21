"""One small measurement for all formats: vectors of every validity, in pixels and frames.

A heap of grains in an image of 9 x 7 vectors (x, y), y down, a mask above it, three frames. No
vector is exactly zero, u and v differ everywhere, and nothing is symmetric, so that a transposed,
flipped or exchanged array shows.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers import Validity, VectorFields

FRAMES, ROWS, COLUMNS = 3, 7, 9
X = 16.0 + 8 * np.arange(COLUMNS)
Y_DOWN = 24.0 + 8 * np.arange(ROWS)
INTERPOLATED = (1, 4, 2)
INVALID = (2, 5, 1)


def codes() -> Any:
    """Validity [T, Y, X], rows from the top of the image."""
    surface = 3 - 2 * np.linspace(1, 0, COLUMNS)  # first row with grains
    rows = np.arange(ROWS)[:, None]
    grains = rows >= surface
    found = np.where(np.broadcast_to(grains, (FRAMES, ROWS, COLUMNS)), Validity.VALID, 0)
    found = found.astype(np.int8)
    found[INTERPOLATED] = Validity.INTERPOLATED
    found[INVALID] = Validity.INVALID
    return found


def velocity() -> tuple[Any, Any]:
    """u and v [T, Y, X] in px/frame, v downwards; a number everywhere."""
    t, y, x = np.meshgrid(np.arange(FRAMES), Y_DOWN, X, indexing="ij")
    return 0.25 + 0.01 * x + 0.003 * y + 0.1 * t, 0.5 + 0.002 * x - 0.004 * y + 0.2 * t


def check(
    fields: VectorFields, frames: int = FRAMES, *, types: bool = True, scale: float = 1.0
) -> None:
    """Compares validity and vectors; what was not measured is NaN, and nothing is 0.

    Args:
        frames: how many of the frames there are.
        types: whether the file tells interpolated vectors from measured ones.
        scale: of the velocity.
    """
    kinds = codes()[:frames]
    if not types:
        kinds[kinds == Validity.INTERPOLATED] = Validity.VALID
    u, v = (a[:frames] for a in velocity())
    order, sign = (slice(None), 1) if fields.y_down else (slice(None, None, -1), -1)
    np.testing.assert_array_equal(fields.validity, kinds[:, order])
    there = np.isin(fields.validity, (Validity.VALID, Validity.INTERPOLATED))
    assert np.isnan(fields.u[~there]).all()
    assert np.isnan(fields.v[~there]).all()
    np.testing.assert_allclose(fields.u[there], scale * u[:, order][there], rtol=1e-6)
    np.testing.assert_allclose(fields.v[there], sign * scale * v[:, order][there], rtol=1e-6)
    assert not (fields.u == 0).any()
    assert not (fields.v == 0).any()


def table(k: int) -> Any:
    """Rows x, y, u, v, code of frame k, x running first, from the top of the image."""
    y, x = np.meshgrid(Y_DOWN, X, indexing="ij")
    u, v = velocity()
    columns = (x, y, u[k], v[k], codes()[k])
    return np.stack([np.ravel(column) for column in columns], axis=1)


def write_lines(path: Path, lines: list[str], newline: str = "\n") -> Path:
    path.write_bytes((newline.join(lines) + newline).encode())
    return path
