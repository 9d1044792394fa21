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
from granpinn.importers.columns import Column, TextTable, header, read_table
from granpinn.importers.numerals import whole
from granpinn.importers.tables import codes_of, grid_frame
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import IMAGES, DataFileError, Validity, VectorFields

_FRAME = re.compile(r"FRAME:\s*+(\d++)")
_FACTOR = re.compile(r"conversion factor (xy|uv) \((?:px -> m|px/frame -> m/s)\):\s*+([-+.\deE]++)")
_NUMBER = re.compile(r"\d++")
_NUMBER_FIRST = re.compile(r"\s*+[-+]?(?:\d|\.\d|nan|inf)", re.IGNORECASE)
FIRST_WORDS = ("PIVlab", "FRAME:")
_HEADER_LINES = 100
_NO_COLUMNS = (*FIRST_WORDS, "TITLE", "VARIABLES", "ZONE")
ROLES = {
    **{name: (name,) for name in "xyuv"},
    "type": ("vector type",),
    "gone": ("isnan", "isnan?"),
}
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
    first = text.splitlines()[0] if text.strip() else ""
    named = {column.name: column.unit for column in header(first)}
    own = {*"xyuv"} <= named.keys() and named["x"] in ("px", "m")
    return text.startswith(FIRST_WORDS) or own


def read(path: Path) -> VectorFields:
    """One frame; see the module for the layout."""
    text = TextFile(path)
    lines = text.head(_HEADER_LINES)
    start = next((i for i, line in enumerate(lines) if _NUMBER_FIRST.match(line)), len(lines))
    head = "\n".join(lines[:start])
    named = _named(path, lines[:start])
    if named:
        table = read_table(text, ROLES, named, "xyuv", start)
    else:
        rows = text.numbers(start)
        if rows.shape[1] < 4:
            raise DataFileError(
                f"{path} must have at least the columns x, y, u, v, got {rows.shape[1]}: export "
                "the vectors again"
            )
        table = TextTable(dict(zip("xyuv", rows.T, strict=False)), {})
        # Without a header only the values show that the fifth column holds vector types.
        if rows.shape[1] > 4 and np.isin(rows[:, 4], list(TYPES)).all():
            table.columns["type"] = rows[:, 4]
    if "gone" in table.columns and table.units.get("u") != "px/frame":
        table.units["u"] = table.units["v"] = ""
    frame = _FRAME.search(head)
    facts = {f"cal{kind}": factor for kind, factor in _FACTOR.findall(head)}
    if numbers := _image_numbers(head):
        facts[IMAGES] = numbers
    return grid_frame(
        path,
        table,
        _codes(path, table.columns),
        t=whole(frame[1], f"{path}: FRAME") - 1 if frame else 0,
        facts=facts,
    )


def _image_numbers(head: str) -> str:
    """The last numbers in the names of both images, "" if these differ in something else."""
    names = head.partition("filenames:")[2].partition(", conversion")[0].split(" & ")
    last = [[*_NUMBER.finditer(name)][-1:] for name in names]
    if len(names) != 2 or not all(last):
        return ""
    (a,), (b,) = last
    rest = [
        name.strip().removeprefix(f"{which}:").strip().replace(number[0], "#")
        for which, name, number in zip("AB", names, (a, b), strict=True)
    ]
    return f"{a[0]} {b[0]}" if rest[0] == rest[1] else ""


def _named(path: Path, lines: list[str]) -> list[Column]:
    """The columns that a header names; none if the file has no such line."""
    texts = [line.lstrip("\ufeff# ") for line in lines]
    others = [text for text in texts if text.strip() and not text.startswith(_NO_COLUMNS)]
    variables = [text for text in texts if text.startswith("VARIABLES")]
    if len(others) > 1 or len(variables) > 1:
        raise DataFileError(
            f"{path} must have one line with the names of its columns, got {others[1][:40]!r} as "
            "another: export the vectors again"
        )
    named = header(others[0]) if others else []
    if not variables:
        return named
    # Of Tecplot: this line has the names, and the comment above the units.
    stated = {column.name: column.unit for column in named}
    names = [name.lower() for name in variables[0].split('"')[1::2]]
    return [Column(name, stated.get(name, "")) for name in names]


def _codes(path: Path, columns: dict[str, Float64]) -> Int8 | None:
    """Validity of every row; None if the file has no vector types."""
    if "gone" in columns:
        return np.where(columns["gone"] == 1, Validity.MASKED, Validity.VALID).astype(np.int8)
    if "type" not in columns:
        return None
    return codes_of(path, "vector types", columns["type"], TYPES)
