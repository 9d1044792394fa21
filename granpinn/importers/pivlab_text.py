"""PIVlab's text export, the "ASCII chart".

    PIVlab, ASCII chart output - 01-Jan-2026                                     (optional)
    FRAME: 3, filenames: a.tif & b.tif, conversion factor xy (px -> m): 1, ...   (optional)
    x [px],y [px],u [px/frame],v [px/frame],Vector type [-]

Separated by commas, tabs or blanks; y runs first, from the top of the image. Masked vectors are
NaN. Vector types (newer versions): 0 masked, 1 measured, 2 rejected or interpolated, 3 measured
(second correlation peak). Without types, interpolated vectors look like measured ones.

The Tecplot export is refused: its header mixes up m/s and m/frame for calibrated data.
"""

from __future__ import annotations

import re
from pathlib import Path

from granpinn.importers.columns import Column, header, read_table
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
ROLES = {**{name: (name,) for name in "xyuv"}, "type": ("vector type",)}
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
    table = read_table(text, ROLES, _named(path, lines[:start]), "xyuv", start)
    types = table.columns.pop("type", None)
    frame = _FRAME.search(head)
    facts = {f"cal{kind}": factor for kind, factor in _FACTOR.findall(head)}
    if numbers := _image_numbers(head):
        facts[IMAGES] = numbers
    return grid_frame(
        path,
        table,
        None if types is None else codes_of(path, "vector types", types, TYPES),
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
    """The columns that the header names, in one line."""
    texts = [line.lstrip("\ufeff# ") for line in lines]
    names = [text for text in texts if text.strip() and not text.startswith(FIRST_WORDS)]
    if len(names) != 1:
        found = f"{names[1][:40]!r} as another" if names else "none"
        raise DataFileError(
            f"{path} must have one line with the names of its columns, got {found}: export the "
            "vectors again, as an ASCII chart with column headers"
        )
    return header(names[0])
