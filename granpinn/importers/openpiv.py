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

from granpinn.arrays import Int8
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.numerals import parse
from granpinn.importers.tables import to_grid, y_points_down
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

_HEADER = ["x", "y", "u", "v", "flags", "mask"]
_FLAGS = {0: Validity.VALID, 1: Validity.INVALID, 2: Validity.INTERPOLATED}


def sniff(path: Path, head: bytes) -> bool:
    """The header of new files; in old ones five numbers a row, x running first."""
    lines = head.decode("utf-8", "replace").lstrip("\ufeff").splitlines()
    if not lines:
        return False
    if lines[0].startswith("#"):
        return lines[0].lstrip("# ").split() == _HEADER
    try:
        first, second = ([parse(cell) for cell in line.split()] for line in lines[:2])
    except ValueError:
        return False
    return len(first) == len(second) == 5 and first[0] != second[0] and first[1] == second[1]


def read(path: Path) -> VectorFields:
    """One frame; see the module for the layout."""
    text = TextFile(path)
    header = text.head(1)[0]
    start = 1 if header.startswith("#") else 0
    table = text.numbers(start)
    columns = table.shape[1]
    if columns not in (5, 6) or (start and header.lstrip("# ").split() != _HEADER[:columns]):
        raise DataFileError(
            f"{path} must have the columns x y u v flags mask of OpenPIV, or x y u v s2n of its "
            f"versions before 0.25, got {columns} columns: save it with openpiv.tools.save"
        )
    codes = _codes(path, table[:, 4], table[:, 5]) if columns == 6 else None
    vectors = dict(zip("xyuv", table.T[:4], strict=True))
    grids = to_grid(path, vectors, codes)
    if codes is None:
        grids["validity"] = split_gaps(np.isfinite(grids["u"]) & np.isfinite(grids["v"]))
    down, facts = y_points_down(vectors)
    kinds = {"vector_types": "no", "mask": GAPS} if codes is None else {"vector_types": "yes"}
    return vector_fields(
        t=[0],
        **grids,
        time_unit="frame",
        y_down=down,
        facts=facts | kinds,
    )


def _codes(path: Path, flags: np.ndarray, mask: np.ndarray) -> Int8:
    unknown = flags[~np.isin(flags, list(_FLAGS))]
    if unknown.size or not np.isin(mask, (0, 1)).all():
        raise DataFileError(
            f"{path} must have flags 0, 1 or 2 and a mask of 0 and 1, got "
            f"{unknown[0] if unknown.size else mask.max():g}: columns 5 and 6 are something else"
        )
    codes = np.array([_FLAGS[int(flag)] for flag in flags], np.int8)
    codes[mask == 1] = Validity.MASKED
    return codes
