"""PIVlab's text exports: "ASCII chart" with any of its headers, and the Tecplot variant.

    PIVlab, ASCII chart output - 01-Jan-2026                                     (optional)
    FRAME: 3, filenames: a.tif & b.tif, conversion factor xy (px -> m): 1, ...   (optional)
    x [px],y [px],u [px/frame],v [px/frame],Vector type [-]                      (optional)

Separated by commas, tabs or blanks; y runs first, from the top of the image. Masked vectors are
NaN. Vector types (newer versions): 0 masked, 1 measured, 2 rejected or interpolated, 3 measured
(second correlation peak). Without types, interpolated vectors look like measured ones.

The Tecplot export has 0 for every missing vector and a column `isNaN`. Its header mixes up m/s and
m/frame for calibrated data, so there the unit of velocity has to be given.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from granpinn.arrays import Float64, Int8
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.numerals import whole
from granpinn.importers.tables import to_grid, y_points_down
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

_FRAME = re.compile(r"FRAME:\s*+(\d++)")
_FACTOR = re.compile(r"conversion factor xy \(px -> m\):\s*+([-+.\deE]++)")
_NUMBER_FIRST = re.compile(r"\s*+[-+]?(?:\d|\.\d|nan|inf)", re.IGNORECASE)
_TITLE = re.compile(r"x \[(px|m)\][,\t ]++y \[")
_HEADER_LINES = 100
# PIVlab's vector types.
TYPES = {
    0: Validity.MASKED,
    1: Validity.VALID,
    2: Validity.INTERPOLATED,
    3: Validity.VALID,
}


def sniff(path: Path, head: bytes) -> bool:
    """Whether the file begins like a PIVlab export."""
    text = head.decode("utf-8", "replace").lstrip("\ufeff# ")
    return text.startswith(("PIVlab", "FRAME:")) or bool(_TITLE.match(text))


def read(path: Path) -> VectorFields:
    """One frame; see the module for the layout."""
    text = TextFile(path)
    lines = text.head(_HEADER_LINES)
    start = next((i for i, line in enumerate(lines) if _NUMBER_FIRST.match(line)), len(lines))
    head = "\n".join(lines[:start])
    table = text.numbers(start)
    if table.shape[1] < 4:
        raise DataFileError(
            f"{path} must have at least the columns x, y, u, v, got {table.shape[1]}: export the "
            "vectors again"
        )
    names, units = _header(lines[:start])
    frame = _FRAME.search(head)
    tecplot = "isNaN" in head
    codes = _codes(path, table, names, tecplot)
    vectors = dict(zip("xyuv", table.T[:4], strict=True))
    grids = to_grid(path, vectors, codes)
    if codes is None:
        grids["validity"] = split_gaps(np.isfinite(grids["u"]) & np.isfinite(grids["v"]))
    facts = {"vector_types": "yes"} if codes is not None else {"vector_types": "no", "mask": GAPS}
    if factor := _FACTOR.search(head):
        facts["meters_per_pixel"] = factor[1]
    velocity_unit = units.get("u")
    if tecplot and velocity_unit != "px/frame":
        velocity_unit = None
    down, order = y_points_down(vectors)
    return vector_fields(
        t=[whole(frame[1], f"{path}: FRAME") - 1 if frame else 0],
        **grids,
        length_unit=units.get("x"),
        time_unit="frame",
        velocity_unit=velocity_unit,
        y_down=down,
        facts=facts | order,
    )


def _header(lines: list[str]) -> tuple[list[str], dict[str, str]]:
    """Names of the columns, and the units of x, y, u, v; empty without that line."""
    for line in lines:
        stripped = line.lstrip("\ufeff# ")
        if stripped.startswith("x ["):
            parts = [column.partition("[") for column in stripped.split("]")[:-1]]
            found = [(name.strip(" ,\t").lower(), unit) for name, _, unit in parts]
            return [name for name, _ in found], dict(found[:4])
    return [], {}


def _codes(path: Path, table: Float64, names: list[str], tecplot: bool) -> Int8 | None:
    """Validity of every row; None if the file has no vector types."""
    column = names.index("vector type") if "vector type" in names else 4
    if (tecplot or "vector type" in names) and table.shape[1] <= column:
        raise DataFileError(
            f"{path} must have {column + 1} columns like its header, got {table.shape[1]}: export "
            "it again"
        )
    if tecplot:
        return np.where(table[:, 4] == 1, Validity.MASKED, Validity.VALID).astype(np.int8)
    if "vector type" in names:
        types = table[:, column]
    elif not names and table.shape[1] >= 5 and np.isin(table[:, 4], list(TYPES)).all():
        types = table[:, 4]
    else:
        return None
    unknown = types[~np.isin(types, list(TYPES))]
    if unknown.size:
        raise DataFileError(
            f"{path} must have the vector types 0, 1, 2 and 3, got {unknown[0]:g}: check that the "
            "columns are those of its header"
        )
    return np.array([TYPES[int(kind)] for kind in types], np.int8)
