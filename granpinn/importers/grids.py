"""Text of PIV and simulation programs, one file per frame: rows of vectors that form a grid.

A program differs from others by its header and by how it marks vectors. Rows are placed by their
coordinates, in any order.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64, Int8
from granpinn.importers.columns import (
    NAMES,
    Column,
    TextTable,
    layout_of,
    read_table,
    require_finite,
    text_lines,
    units_of,
)
from granpinn.importers.units import whole
from granpinn.importers.vectors import (
    GAPS,
    DataFileError,
    Validity,
    VectorFields,
    split_gaps,
)

# Coordinates that differ by less than this part of the spacing belong to one column.
SAME = 0.01
# The fact of files whose rows are in no order that shows the direction of y.
ROWS, MIXED = "rows", "mixed"
_VECTORS = {name: NAMES[name] for name in "xyuv"}


# PIVlab: the "ASCII chart".
#
#     PIVlab, ASCII chart output - 01-Jan-2026                                     (optional)
#     FRAME: 3, filenames: a.tif & b.tif, conversion factor xy (px -> m): 1, ...   (optional)
#     x [px],y [px],u [px/frame],v [px/frame],Vector type [-]
#
# Separated by commas, tabs or blanks; y runs first, from the top of the image. Masked vectors are
# NaN. Without types (older versions), interpolated vectors look like measured ones. The Tecplot
# export is refused: its header mixes up m/s and m/frame for calibrated data.
PIVLAB = ("PIVlab", "FRAME:")
# 3: measured by the second correlation peak.
PIVLAB_TYPES = {
    0: Validity.MASKED,
    1: Validity.VALID,
    2: Validity.INTERPOLATED,
    3: Validity.VALID,
}
PIVLAB_CODES = {"vector type": PIVLAB_TYPES}
_FRAME = re.compile(r"FRAME:\s*+(\d++)")
_FACTOR = re.compile(r"conversion factor (xy|uv) \((?:px -> m|px/frame -> m/s)\):\s*+([-+.\deE]++)")


# OpenPIV: `openpiv.tools.save` since version 0.25. Masked vectors are written as 0.0, so only the
# two last columns matter. The files do not state their units, which are pixels per unit of `dt` or
# the result of `scaling.uniform`. Rows run from the top of the image.
OPENPIV_CODES = {
    "flags": {0: Validity.VALID, 1: Validity.INVALID, 2: Validity.INTERPOLATED},
    "mask": {0: Validity.VALID, 1: Validity.MASKED},
}


# Any other program: a table that names x, y, u and v as columns.py knows them, units in brackets. y
# points up where lengths have a unit other than px; elsewhere --flip-y says so.
def read_rows(
    path: Path,
    codes: Mapping[str, Mapping[int, Validity]] | None = None,
    required: Iterable[str] = (),
) -> VectorFields:
    """One frame of a table with the names of its columns, of PIVlab, OpenPIV or any other program.

    Args:
        codes: of the program, by columns that a file may have: what their numbers say of a vector,
            the last column first. None: any other program.
        required: columns with codes that may not be missing.
    """
    lines = text_lines(path)
    roles = _VECTORS | {name: (name,) for name in codes or ()}
    named, skip = layout_of(lines, roles, "xyuv")
    table = read_table(path, roles, named, [*"xyuv", *required], skip)
    validity = None
    for name, known in (codes or {}).items():
        if name in table.columns:
            kinds = codes_of(path, name, table.columns.pop(name), known)
            before = kinds if validity is None else validity
            validity = np.where(kinds == Validity.VALID, before, kinds)
    head = "\n".join(lines[:skip])
    frame = _FRAME.search(head)
    found = grid_frame(
        path,
        table,
        validity,
        t=whole(frame[1], f"{path}: FRAME") - 1 if frame else 0,
        y_down=None if codes else False,
        facts={f"cal{kind}": factor for kind, factor in _FACTOR.findall(head)},
    )
    if codes or found.length_unit not in (None, "px"):
        return found
    return replace(found, y_down=None, facts=found.facts | {ROWS: MIXED})


read_pivlab = partial(read_rows, codes=PIVLAB_CODES)
read_openpiv = partial(read_rows, codes=OPENPIV_CODES, required=OPENPIV_CODES)


# DaVis 8: `#DaVis 8.1.6 2D-vector 32 64 64 "position" "mm" "position" "mm" "velocity" "m/s"`, then
# x, y, u, v separated by tabs, often with decimal commas. An exact (0, 0) means "no vector".
_DAVIS = re.compile(r"#\s*+DaVis\s++\S++\s++2D-vector\s++\d++\s++(\d++)\s++(\d++)\s*+(.*+)")


def read_davis(path: Path) -> VectorFields:
    """One frame of the text export of DaVis."""
    first = text_lines(path)[0]
    head = _DAVIS.match(first)
    if head is None:
        raise DataFileError(
            f"{path} must begin with '#DaVis ... 2D-vector', got {first[:40]!r}: export the "
            "vectors from DaVis as text"
        )
    quoted = head[3].split('"')[1::2]
    units: dict[str, list[str]] = {"position": [], "velocity": []}
    for name, unit in zip(quoted[::2], quoted[1::2], strict=False):
        kind = name.replace("displacement", "velocity")
        pixels = kind == "velocity" and unit in ("pixel", "px")
        units.setdefault(kind, []).append("px/frame" if pixels else unit)
    # One unit holds for both components.
    both = [(units[kind] or [""])[k] for kind in ("position", "velocity") for k in (0, -1)]
    named = [*map(Column, "xyuv", both)]
    table = read_table(path, _VECTORS, named, "xyuv")
    expected = whole(head[1], f"{path}: columns") * whole(head[2], f"{path}: rows")
    if (count := table.columns["x"].size) != expected:
        raise DataFileError(
            f"{path} must hold {expected} vectors as its header says, got {count}: the file was "
            "cut off; export it again"
        )
    none = (table.columns["u"] == 0) & (table.columns["v"] == 0)
    for name in "uv":
        table.columns[name] = np.where(none, np.nan, table.columns[name])
    # Of displacements in pixels, the order of the rows shows the direction of y.
    return grid_frame(path, table, y_down=None if "px/frame" in both else False)


# Basilisk: `output_field` with a header `# 1:x 2:y 3:f 4:p 5:u.x 6:u.y`. Values outside the domain
# are `nodata`, a huge number that prints as inf. The file holds no time, which --times gives. The
# numbers have the units of the simulation, mostly none.
NUMBERED = re.compile(r"(?<!\S)\d++:(\S++)")
_BASILISK = {"x": ("x",), "y": ("y",), "u": ("u.x",), "v": ("u.y",), "c": ("f", "c"), "p": ("p",)}
_NODATA = 1e29  # that of single-precision builds is 1e30


def read_basilisk(path: Path) -> VectorFields:
    """One frame of Basilisk."""
    first = text_lines(path)[0]
    named = [Column(name) for name in NUMBERED.findall(first)]
    table = read_table(path, _BASILISK, named, "xyuv")
    parts = table.columns
    there = (np.abs(parts["u"]) < _NODATA) & (np.abs(parts["v"]) < _NODATA)
    if "c" in parts:
        parts["c"] = np.where(there, np.nan_to_num(parts["c"], posinf=0.0), 0.0)
    if "p" in parts:
        parts["p"] = np.where(there & np.isfinite(parts["p"]), parts["p"], np.nan)
    codes = np.where(there, np.int8(Validity.VALID), np.int8(Validity.MASKED))
    return grid_frame(path, table, codes, y_down=False)


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
        table: x, y, u, v and perhaps c and p [n].
        validity: of every row; None: the gaps in u and v show it.
        t: number of the frame.
        y_down: None: the order of the rows shows it.
        facts: for the record.
    """
    columns, found = dict(table.columns), dict(facts or {})
    require_finite(path, {name: columns[name] for name in "xy"})
    (x, column), (y, row) = _axis(columns.pop("x")), _axis(columns.pop("y"))
    shape = (y.size, x.size)
    place = np.ravel_multi_index((row, column), shape)
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
    if y_down is None and (y_down := _y_points_down(row, column)) is None:
        found[ROWS] = MIXED
    order = np.argsort(place)
    grids: dict[str, Any] = {n: a[order].reshape(1, *shape) for n, a in columns.items()}
    if validity is None:
        found["mask"] = GAPS
        codes = split_gaps(np.isfinite(grids["u"]) & np.isfinite(grids["v"]))
    else:
        codes = np.asarray(validity)[order].reshape(1, *shape)
    units = units_of(path, table.units) | {"time_unit": "frame"}
    return VectorFields(
        t=[t], y=y, x=x, **grids, validity=codes, **units, y_down=y_down, facts=found
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


def _y_points_down(row: Any, column: Any) -> bool | None:
    """Whether y grows along a file that begins at the top of the image.

    The order of the rows shows it if x grows along the file and y runs the same way in every
    column. None: rows in another order, such as sorted ones, do not show it.

    Args:
        row, column: of the grid, for every line of the file [n].
    """
    Y, X = int(row.max()) + 1, int(column.max()) + 1
    by_rows = row.reshape(Y, X), column.reshape(Y, X)
    by_columns = row.reshape(X, Y).T, column.reshape(X, Y).T
    for rows, places in (by_rows, by_columns):
        step = int(rows[1, 0]) - int(rows[0, 0])
        if step not in (1, -1) or (places != np.arange(X)).any():
            continue
        if (rows == np.arange(Y)[::step, None]).all():
            return step > 0
    return None
