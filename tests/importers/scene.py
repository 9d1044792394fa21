"""One small measurement for all formats: vectors of every validity, in pixels and frames.

A heap of grains in an image of 9 x 7 vectors (x, y), y down, a mask above it, three frames. No
vector is exactly zero, u and v differ everywhere, and nothing is symmetric, so that a transposed,
flipped or exchanged array shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
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


def fraction() -> Any:
    """Volume fraction [T, Y, X] of a simulation: 1 in the grains, the cell above partly filled."""
    above = np.arange(ROWS)[:, None] - (3 - 2 * np.linspace(1, 0, COLUMNS))
    return np.broadcast_to(np.clip(above + 1, 0, 1), (FRAMES, ROWS, COLUMNS))


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


# SI units in a unit of a file; a frame is the time between two images.
SI = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "px": 0.5e-3, "s": 1.0, "ms": 1e-3}
SI |= {"frame": 2e-3, "pix": 0.5e-3, "dt": 2e-3, "seconds": 1.0, "hours": 3600.0}


def si(unit: str) -> float:
    """SI units in one "mm" or "px/frame"."""
    length, _, time = unit.partition("/")
    return SI[length] / SI[time] if time else SI[length]


@dataclass(frozen=True)
class View:
    """How an instrument sees the scene: the units of x, y, u, v, and whether y points up.

    With y up the origin is the lower left vector, else it lies left of and above the image.
    """

    x: str = "px"
    y: str = "px"
    u: str = "px/frame"
    v: str = "px/frame"
    up: bool = False

    @property
    def units(self) -> tuple[str, ...]:
        return astuple(self)[:4]

    def axes(self) -> tuple[Any, Any]:
        """x, and y from the top of the image, in the units of the file."""
        x, y = (X - X[0], Y_DOWN[-1] - Y_DOWN) if self.up else (X, Y_DOWN)
        return x * SI["px"] / si(self.x), y * SI["px"] / si(self.y)

    def velocity(self) -> tuple[Any, Any]:
        """u and v [T, Y, X], rows from the top of the image."""
        u, v = velocity()
        sign = -1 if self.up else 1
        return u * si("px/frame") / si(self.u), sign * v * si("px/frame") / si(self.v)


PIXELS = View()
METERS = View("m", "m", "m/s", "m/s")


def table(k: int, view: View = PIXELS) -> Any:
    """Rows x, y, u, v, code of frame k, x running first, from the top of the image."""
    x, y = view.axes()
    y, x = np.meshgrid(y, x, indexing="ij")
    u, v = view.velocity()
    columns = (x, y, u[k], v[k], codes()[k])
    return np.stack([np.ravel(column) for column in columns], axis=1)


def write_lines(path: Path, lines: list[str], newline: str = "\n") -> Path:
    path.write_bytes((newline.join(lines) + newline).encode())
    return path


def write_table(
    path: Path,
    head: Sequence[str],
    names: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    title: str = "{}",
    delimiter: str = ",",
    decimal: str = ".",
    order: str = "",
    quote: str = "",
    newline: str = "\n",
    mark: str = "",
) -> Path:
    """A table of text.

    Args:
        head: lines before the table.
        names: of the columns, none = no line of names.
        title: the line of names, without them.
        decimal: sign in all numbers.
        order: numbers of the columns that come first; the others follow.
        quote: around all cells.
        mark: at the beginning of the file.
    """
    first = [int(digit) for digit in order]
    numbers = [[cell.replace(".", decimal) for cell in row] for row in rows]
    lines = []
    for cells in [names or numbers[0], *numbers]:
        placed = [cells[i] for i in first] + [c for i, c in enumerate(cells) if i not in first]
        lines.append(delimiter.join(f"{quote}{cell}{quote}" for cell in placed))
    lines = [*head, *([title.format(lines[0])] if names else []), *lines[1:]]
    return write_lines(path, [mark + lines[0], *lines[1:]], newline)


def text(*numbers: float) -> list[str]:
    """Cells of a table with ten digits."""
    return [f"{number:.10g}" for number in numbers]
