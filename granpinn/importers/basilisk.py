"""Basilisk's `output_field`: text with a header `# 1:x 2:y 3:f 4:p 5:u.x 6:u.y`, one file per time.

x is the outer loop, with a blank line after every x. Values outside the domain are `nodata`, a huge
number that prints as inf. The file holds no time, which --times gives. The numbers have the units
of the simulation, mostly none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from granpinn.importers.columns import Column, read_table
from granpinn.importers.tables import to_grid
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

_COLUMN = re.compile(r"(?<!\S)\d++:(\S++)")
_FIRST = re.compile(rb"#\s*+1:x\s++2:y\b")
# Usual names of the fields.
ROLES = {"x": ("x",), "y": ("y",), "u": ("u.x",), "v": ("u.y",), "c": ("f", "c"), "p": ("p",)}
_HUGE = 1e29  # nodata of single-precision builds is 1e30


def sniff(path: Path, head: bytes) -> bool:
    """The numbered columns of output_field."""
    return bool(_FIRST.match(head))


def read(path: Path, columns: Mapping[str, str] | None = None) -> VectorFields:
    """One frame.

    Args:
        columns: names of u, v, c and p in the file, if they are not the usual ones.
    """
    text = TextFile(path)
    first = text.head(1)[0]
    names = _COLUMN.findall(first)
    if names[:2] != ["x", "y"]:
        raise DataFileError(
            f"{path} must begin with '# 1:x 2:y ...', got {first[:40]!r}: write it with "
            "output_field"
        )
    given: dict[str, tuple[str, ...]] = {role: (name,) for role, name in (columns or {}).items()}
    required = ("x", "y", "u", "v", *given)
    parts = read_table(text, ROLES | given, [*map(Column, names)], required).columns
    there = (np.abs(parts["u"]) < _HUGE) & (np.abs(parts["v"]) < _HUGE)
    codes = np.where(there, Validity.VALID, Validity.MASKED)
    for role in ("c", "p"):
        if role in parts:
            parts[role] = np.where(there & np.isfinite(parts[role]), parts[role], np.nan)
    grids = to_grid(path, parts, codes)
    if "c" in grids:
        grids["c"] = np.nan_to_num(grids["c"])
    return vector_fields(t=[0], **grids, time_unit="frame", y_down=False)
