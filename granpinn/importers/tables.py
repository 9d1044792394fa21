"""Text tables of numbers: separators, decimal commas, and lists of vectors that form a grid."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers.vectors import DataFileError

MAX_BYTES = 2**30
# Coordinates that differ by less than this part of the spacing belong to one column.
SAME = 0.01


def read_text(path: Path) -> str:
    """The text of a file, without the byte order mark and with plain line ends."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise DataFileError(
                f"{path} must hold at most {MAX_BYTES / 2**30:.3g} GiB, got "
                f"{path.stat().st_size / 2**30:.3g} GiB: split it into one file per frame"
            )
        content = path.read_bytes()
    except OSError as error:
        raise DataFileError(f"{path} cannot be opened ({error.strerror}): check it") from None
    if b"\0" in content[:4096]:
        raise DataFileError(f"{path} must be text, got binary data: name its --format")
    text = content.decode("utf-8-sig", "replace").replace("\r\n", "\n").replace("\r", "\n")
    if not text.strip():
        raise DataFileError(f"{path} is empty, expected a table of vectors: export it again")
    return text


def numbers(
    path: Path, lines: Sequence[str], *, first_line: int = 1, decimal_comma: bool = False
) -> Float64:
    """The rows of a table as [rows, columns]; blank lines are skipped.

    Args:
        lines: separated by tabs, blanks, commas or semicolons.
        first_line: number of the first line in the file, for the message.
        decimal_comma: whether "," is the decimal point.
    """
    separator = re.compile(r"[\t ;]+" if decimal_comma else r"[\t ]*[,;\t ][\t ]*")
    rows: list[list[float]] = []
    for number, line in enumerate(lines, first_line):
        if not line.strip():
            continue
        cells = separator.split(line.strip().rstrip(",;").rstrip())
        try:
            row = [float(c.replace(",", ".") if decimal_comma else c) for c in cells]
        except ValueError:
            raise DataFileError(
                f"{path}, line {number}: expected numbers, got {line.strip()[:60]!r}: this is not "
                "the format it was taken for, or the line is damaged"
            ) from None
        if rows and len(row) != len(rows[0]):
            raise DataFileError(
                f"{path}, line {number}: expected {len(rows[0])} columns as above, got {len(row)}: "
                "the file was cut off or mixes tables; export it again"
            )
        rows.append(row)
    if not rows:
        raise DataFileError(f"{path} has no rows of numbers: export it again")
    return np.array(rows)


def to_grid(path: Path, columns: Mapping[str, Float64], validity: Any = None) -> dict[str, Any]:
    """Arrays [1, Y, X] and axes of one frame from lists of x, y, u, v and others [n].

    Args:
        columns: must hold x and y; all others become grids.
        validity: of every row, an array [n].

    Returns:
        x, y, every other column [1, Y, X], and `validity` if it was given.
    """
    axes, places = {}, {}
    for name in ("x", "y"):
        axes[name], places[name] = _axis(columns[name])
    shape = (axes["y"].size, axes["x"].size)
    place = np.ravel_multi_index((places["y"], places["x"]), shape)
    n_rows, n_places = place.size, np.unique(place).size
    if n_places < n_rows:
        raise DataFileError(
            f"{path} must have one vector at every point, got {n_rows - n_places} points twice: "
            "it mixes grids or frames"
        )
    if min(shape) < 2 or n_places < shape[0] * shape[1]:
        raise DataFileError(
            f"{path} must hold a full grid of vectors, got {n_rows} rows for {shape[0]} x "
            f"{shape[1]} different y and x: the file was cut off or mixes grids; if these are "
            "scattered vectors use --format tracks"
        )
    order = np.argsort(place)
    grids: dict[str, Any] = dict(axes)
    for name, values in columns.items():
        if name not in axes:
            grids[name] = values[order].reshape(1, *shape)
    if validity is not None:
        grids["validity"] = np.asarray(validity, np.int8)[order].reshape(1, *shape)
    return grids


def _axis(values: Float64) -> tuple[Float64, Any]:
    """The different values, ascending, and the index of each; equal up to rounding in text."""
    order = np.argsort(values, kind="stable")
    ascending = values[order]
    steps = np.diff(ascending)
    large = steps[steps > 0.1 * steps.max(initial=0.0)]
    limit = SAME * float(np.median(large)) if large.size else 0.0
    group = np.concatenate([[0], np.cumsum(steps > limit)])
    axis = np.bincount(group, weights=ascending) / np.bincount(group)
    index = np.empty(values.size, np.intp)
    index[order] = group
    return axis, index


def y_points_down(y: Float64) -> bool | None:
    """Whether y grows along a file [n] that begins at the top of the image."""
    steps = np.diff(y)
    steps = steps[steps != 0]
    return None if steps.size == 0 else bool(steps[0] > 0)
