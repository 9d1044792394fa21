"""Tables that pandas wrote into HDF5, by h5py: pandas would unpickle the names of their columns.

Tables of TracTrac, too: Frame [n], x [n, 2] and u [n, 2].
"""

from __future__ import annotations

import pickletools
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5g, h5l

from granpinn.foreign import hdf5
from granpinn.foreign.program import Answer
from granpinn.regular import UnsafeFileError

LIBRARY = "h5py"
TRACTRAC = ("Frame", "x", "u")
_DIGITS = re.compile(r"\d++")
_TEXT_OPCODES = ("UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "STRING")


def read(path: Path, answer: Answer, columns: bool = True) -> Any:
    """Columns of all tables by name, those of one frame after another; or the number of tables."""
    with hdf5.opened(path) as file:
        if all(file.id.links.exists(name.encode()) for name in TRACTRAC):  # follows no link
            return _tractrac(file, answer) if columns else 1
        tables = _tables(file)
        if not columns:
            return len(tables)
        answer.require(sum(table.size * table.dtype.itemsize for table in tables))
        parts = [part for table in tables if (part := _columns(table))]
    if any(part.keys() != parts[0].keys() for part in parts):
        raise UnsafeFileError("it must have the same columns in every frame: write it again")
    names = parts[0] if parts else ()
    return {n: answer.keep(np.concatenate([part[n] for part in parts], dtype=float)) for n in names}


def _tractrac(file: h5py.File, answer: Answer) -> Any:
    parts: list[Any] = [hdf5.dataset_of(file, name) for name in TRACTRAC]
    frame, x, u = parts
    if len(frame.shape) != 1 or not x.shape == u.shape == (*frame.shape, 2):
        raise UnsafeFileError(
            f"Frame [n], x and u [n, 2] must fit together, got {list(frame.shape)}, "
            f"{list(x.shape)} and {list(u.shape)}: write them again"
        )
    answer.require(5 * 8 * frame.size)
    n, x, u = (hdf5.values(part.name, part) for part in parts)
    columns = {"frame": n, "x": x[:, 0], "y": x[:, 1], "u": u[:, 0], "v": u[:, 1]}
    return {name: answer.keep(np.asarray(values, float)) for name, values in columns.items()}


def _tables(file: h5py.File) -> list[h5py.Dataset]:
    """The tables that lie in this file, in the natural order of their frames."""
    found = []
    linked = [name for name in file.id if file.id.links.get_info(name).type == h5l.TYPE_HARD]
    groups = [n.decode() for n in linked if h5g.get_objinfo(file.id, n).type == h5g.GROUP]
    for name in sorted(groups, key=_frame_number):
        table = hdf5.dataset_of(file, f"{name}/table")
        if table is not None and table.dtype.names and not table.dtype.hasobject:
            found.append(table)
    return found


def _frame_number(name: str) -> list[tuple[int, str]]:
    """Key that sorts Frame_9 before Frame_10, without integers of any length."""
    digits = [text.lstrip("0") for text in _DIGITS.findall(name)]
    return [(len(text), text) for text in digits]


def _columns(table: h5py.Dataset) -> dict[str, Any]:
    """Columns of a table: single ones, and blocks whose names an attribute lists."""
    rows = hdf5.values(table.name, table)
    found: dict[str, Any] = {}
    for field in rows.dtype.names or ():
        block = rows[field]
        if field == "index" or block.dtype.kind not in "fiu":
            continue
        names = [field]
        if field.startswith("values_block"):
            names = _listed(table.attrs.get(f"{field}_kind"))
        columns = block.reshape(len(rows), -1).T
        if len(names) != len(columns) or len({*found, *names}) != len(found) + len(names):
            raise UnsafeFileError(
                f"{field} must have another name for each of its {len(columns)} columns, got "
                f"{len(names)}: write it again"
            )
        found |= dict(zip(names, columns, strict=True))
    return found


def _listed(content: Any) -> list[str]:
    """The strings of a pickled list of strings, read as data: nothing is unpickled."""
    operations = pickletools.genops(content if isinstance(content, bytes) else b"")
    return [str(arg) for code, arg, _ in operations if code.name in _TEXT_OPCODES]
