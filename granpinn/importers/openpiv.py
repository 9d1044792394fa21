"""OpenPIV's text files, as `openpiv.tools.save` writes them.

Since 0.25: tabs, a header `# x y u v flags mask`; flags 0 valid, 1 invalid, 2 interpolated, mask 1
= masked out. Masked vectors are written as 0.0, so only the two last columns matter. Older: five
columns separated by blanks, the last the signal-to-noise ratio; no validity.

Neither states its units, which are pixels per unit of `dt` or the result of `scaling.uniform`. y
points down unless `transform_coordinates` was used. Rows run from the top of the image, so the
order of the rows shows the direction of y.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from granpinn.importers.columns import TextTable, header, read_table
from granpinn.importers.numerals import parse
from granpinn.importers.tables import codes_of, grid_frame
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import DataFileError, Validity, VectorFields

_NEW, _OLD = ("x", "y", "u", "v", "flags", "mask"), ("x", "y", "u", "v", "s2n")
_MASK = {0: Validity.VALID, 1: Validity.MASKED}
_FLAGS = {0: Validity.VALID, 1: Validity.INVALID, 2: Validity.INTERPOLATED}


def sniff(path: Path, head: bytes) -> bool:
    """The header of new files; in old ones five numbers a row, x running first."""
    lines = head.decode("utf-8", "replace").lstrip("\ufeff").splitlines()
    if not lines:
        return False
    if lines[0].startswith("#"):
        return {column.name for column in header(lines[0])} == {*_NEW}
    try:
        first, second = ([parse(cell) for cell in line.split()] for line in lines[:2])
    except ValueError:
        return False
    return len(first) == len(second) == 5 and first[0] != second[0] and first[1] == second[1]


def read(path: Path) -> VectorFields:
    """One frame; see the module for the layout."""
    text = TextFile(path)
    line = text.head(1)[0]
    named = header(line) if line.startswith("#") else []
    if named:
        table = read_table(text, {name: (name,) for name in _NEW}, named, _NEW)
    else:
        rows = text.numbers()
        names = {len(_NEW): _NEW, len(_OLD): _OLD}.get(rows.shape[1])
        if names is None:
            raise DataFileError(
                f"{path} must have the columns x y u v flags mask of OpenPIV, or x y u v s2n of "
                f"its versions before 0.25, got {rows.shape[1]} columns: save it with "
                "openpiv.tools.save"
            )
        table = TextTable(dict(zip(names, rows.T, strict=True)), {})
    columns = table.columns
    if "s2n" in columns:
        return grid_frame(path, table)
    codes = codes_of(path, "flags", columns["flags"], _FLAGS)
    outside = codes_of(path, "mask", columns["mask"], _MASK) == Validity.MASKED
    return grid_frame(path, table, np.where(outside, np.int8(Validity.MASKED), codes))
