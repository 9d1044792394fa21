"""Lists of vectors that form a grid, placed by their coordinates in any order of the rows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64, Int8
from granpinn.importers.columns import TextTable, require_finite, units_of
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.numerals import whole
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

# Coordinates that differ by less than this part of the spacing belong to one column.
SAME = 0.01
# The fact of files whose rows are in no order that shows the direction of y.
ROWS, MIXED = "rows", "mixed"


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
        require_finite(path, {name: columns[name]})
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


def codes_of(path: Path, what: str, values: Float64, known: Mapping[int, Validity]) -> Int8:
    """Validity of every row by the codes of a program; `what` are these, for the message."""
    codes = np.full(values.shape, -1, np.int8)
    for value, validity in known.items():
        codes[values == value] = validity
    if (codes < 0).any():
        raise DataFileError(
            f"{path} must have the {what} {', '.join(map(str, known))}, got "
            f"{values[codes < 0][0]:g}: check that the columns are those of its header"
        )
    return codes


def require_rows(path: Path, found: int, columns: str, rows: str) -> None:
    """Refuses a file with other than the columns times rows that its header states."""
    expected = whole(columns, f"{path}: columns") * whole(rows, f"{path}: rows")
    if found != expected:
        raise DataFileError(
            f"{path} must hold {expected} vectors as its header says, got {found}: the file was "
            "cut off; export it again"
        )


def grid_frame(
    path: Path,
    table: TextTable,
    validity: Any = None,
    *,
    t: float = 0,
    y_down: bool | None = None,
    facts: Mapping[str, str] | None = None,
) -> VectorFields:
    """One frame of a file of rows.

    Args:
        table: x, y, u and v [n]; its other columns are left out.
        validity: of every row; None: the gaps in u and v show it.
        t: number of the frame.
        y_down: None: the order of the rows shows it.
        facts: further ones.
    """
    vectors = {name: table.columns[name] for name in "xyuv"}
    grids = to_grid(path, vectors, validity)
    kinds = {"vector_types": "yes"}
    if validity is None:
        grids["validity"] = split_gaps(np.isfinite(grids["u"]) & np.isfinite(grids["v"]))
        kinds = {"vector_types": "no", "mask": GAPS}
    down, order = (y_down, {}) if y_down is not None else y_points_down(vectors)
    return vector_fields(
        t=[t],
        **grids,
        **units_of(path, table.units) | {"time_unit": "frame"},
        y_down=down,
        facts=kinds | order | dict(facts or {}),
    )


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


def y_points_down(columns: Mapping[str, Float64]) -> tuple[bool | None, dict[str, str]]:
    """Whether y grows along a file that begins at the top of the image, and facts for the record.

    The order of the rows shows it if x grows along the file and y runs the same way in every
    column. Rows in another order, such as sorted ones, do not show it: then the fact `ROWS` says
    so, and the direction must be given.

    Args:
        columns: x and y of a full grid [n], in the order of the file.
    """
    (x, column), (y, row) = _axis(columns["x"]), _axis(columns["y"])
    by_rows = row.reshape(y.size, x.size), column.reshape(y.size, x.size)
    by_columns = row.reshape(x.size, y.size).T, column.reshape(x.size, y.size).T
    for rows, places in (by_rows, by_columns):
        step = int(rows[1, 0]) - int(rows[0, 0])
        if step not in (1, -1) or (places != np.arange(x.size)).any():
            continue
        if (rows == np.arange(y.size)[::step, None]).all():
            return step > 0, {}
    return None, {ROWS: MIXED}
