"""OpenPIV's text files, as `openpiv.tools.save` writes them since version 0.25.

Tabs, a header `# x y u v flags mask`; flags 0 valid, 1 invalid, 2 interpolated, mask 1 = masked
out. Masked vectors are written as 0.0, so only the two last columns matter.

The files do not state their units, which are pixels per unit of `dt` or the result of
`scaling.uniform`. y points down unless `transform_coordinates` was used. Rows run from the top of
the image, so the order of the rows shows the direction of y.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from granpinn.importers.columns import header, read_table
from granpinn.importers.tables import codes_of, grid_frame
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import DataFileError, Validity, VectorFields

_NAMES = ("x", "y", "u", "v", "flags", "mask")
_MASK = {0: Validity.VALID, 1: Validity.MASKED}
_FLAGS = {0: Validity.VALID, 1: Validity.INVALID, 2: Validity.INTERPOLATED}


def sniff(path: Path, head: bytes) -> bool:
    """The names of the columns behind a #."""
    first, *_ = head.decode("utf-8", "replace").lstrip("\ufeff").splitlines() or [""]
    return first.startswith("#") and {column.name for column in header(first)} == {*_NAMES}


def read(path: Path) -> VectorFields:
    """One frame; see the module for the layout."""
    text = TextFile(path)
    first = text.head(1)[0]
    if not first.startswith("#"):
        raise DataFileError(
            f"{path} must begin with '# x y u v flags mask', got {first[:40]!r}: save it with "
            "openpiv.tools.save of version 0.25 or later"
        )
    table = read_table(text, {name: (name,) for name in _NAMES}, header(first), _NAMES)
    codes = codes_of(path, "flags", table.columns["flags"], _FLAGS)
    outside = codes_of(path, "mask", table.columns["mask"], _MASK) == Validity.MASKED
    return grid_frame(path, table, np.where(outside, np.int8(Validity.MASKED), codes))
