"""Tables of tracked particles (PTV): CSV, and HDF5 as trackpy's PandasHDFStore writes it.

Columns by name, in any order, units in brackets if at all, such as `x [mm]`:

- x, y; and frame, or t (time);
- particle (also id, track, trajectory): the number of the track; velocities then come from local
  polynomials over its frames;
- or u, v (also vx, vy): velocities of the tracking program, with sigma_u, sigma_v;
- ep: trackpy's uncertainty of the position.

trackpy counts in pixels and frames, with y down. Its HDF5 is read without pandas, which would run
foreign code to unpack the names of the columns.
"""

from __future__ import annotations

import csv
import pickletools
import re
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.data.hdf5 import SafeFile, open_hdf5
from granpinn.data.hdf5.dataset import Dataset
from granpinn.importers.textfile import MAX_BYTES, MAX_COLUMNS, Rows, TextFile
from granpinn.importers.tracking import Motion, velocities
from granpinn.importers.vectors import (
    LARGEST,
    DataFileError,
    Validity,
    VectorFields,
    largest,
    vector_fields,
)
from granpinn.regular import UnsafeFileError

NAMES = {
    "x": ("x", "x_position", "pos_x", "position_x"),
    "y": ("y", "y_position", "pos_y", "position_y"),
    "frame": ("frame", "frame_number", "frame_id"),
    "t": ("t", "time"),
    "particle": ("particle", "id", "track", "track_id", "trajectory", "particle_id"),
    "u": ("u", "vx", "v_x", "u_x"),
    "v": ("v", "vy", "v_y", "u_y"),
    "sigma_u": ("sigma_u", "sigma_vx"),
    "sigma_v": ("sigma_v", "sigma_vy"),
    "ep": ("ep",),
}
# A name of a column, and its unit in brackets.
_COLUMN = re.compile(r"([^\[(]++)(?:[\[(]([^\])]*+)[\])])?")
_BRACKETS = re.compile(r"[\[(]([^\])\[(]*+)[\])]")
_DIGITS = re.compile(r"\d++")
_TRACKPY = {"mass", "ecc", "raw_mass", "signal", "size"}
_TEXT_OPCODES = ("UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "STRING")


def sniff(path: Path, head: bytes) -> bool:
    """A header line with x, y and frame or t; or the tables of pandas in HDF5."""
    if head.startswith(b"\x89HDF"):
        return path.suffix.lower() in (".h5", ".hdf5", ".hdf") and _has_tables(path)
    first = head.decode("utf-8", "replace").lstrip("\ufeff").split("\n", 1)[0].lower()
    found, _ = _known(_split(first))
    return {"x", "y"} <= found.keys() and bool({"frame", "t"} & found.keys())


def read(path: Path, window: int = 5) -> VectorFields:
    """Scattered vectors of all tracks.

    Args:
        window: frames of the local polynomial, an odd number; not used if the table has u, v.
    """
    with path.open("rb") as stream:
        hdf5 = stream.read(8) == b"\x89HDF\r\n\x1a\n"
    names, table = _read_hdf5(path) if hdf5 else _read_csv(path)
    found, units = _known(names)
    trackpy = len(_TRACKPY & {name.lower() for name in names}) >= 2
    missing = [name for name in ("x", "y") if name not in found]
    missing += [] if {"frame", "t"} & found.keys() else ["frame (or t)"]
    missing += [] if "particle" in found or {"u", "v"} <= found.keys() else ["particle (or u, v)"]
    if missing:
        raise DataFileError(
            f"{path} must have the columns {', '.join(missing)}, got {', '.join(names[:12])}: "
            "rename them" + (" or link the positions to tracks first" if trackpy else "")
        )
    columns = {name: table[:, i] for name, i in found.items()}
    for name, values in columns.items():
        if np.isinf(values).any() or largest(values) > LARGEST:
            raise DataFileError(
                f"{path} must have a {name} of at most {LARGEST:g} in every row, got "
                f"{np.nanmax(np.abs(values)):g}: leave this row out"
            )
    timed = "t" in found
    t = columns["t" if timed else "frame"]
    if trackpy:
        units = {"x": "px", "ep": "px"} | units
    length = units.get("x")
    time_unit = units.get("t") if timed else "frame"
    if "u" in found and "v" in found:
        motion = Motion(columns["x"], columns["y"], columns["u"], columns["v"])
        motion = motion._replace(sigma_u=columns.get("sigma_u"), sigma_v=columns.get("sigma_v"))
        velocity_unit = units.get("u")
    else:
        count = columns["frame"] if "frame" in found else t
        motion = velocities(
            t, count, columns["x"], columns["y"], columns["particle"], columns.get("ep"), window
        )
        velocity_unit = None if length is None or time_unit is None else f"{length}/{time_unit}"
    finite = np.asarray(np.isfinite([motion.x, motion.y, t]).all(axis=0))
    if not finite.any():
        raise DataFileError(f"{path} holds no particle with a position and a time: export it again")
    measured = np.isfinite(motion.u) & np.isfinite(motion.v)
    # The order of the rows in the file must not matter: equal vectors give equal flows.
    keys = [columns.get("particle"), t]
    order = np.lexsort(
        [k for k in (motion.v, motion.u, motion.y, motion.x, *keys) if k is not None]
    )
    order = order[finite[order]]
    parts: dict[str, Any] = {**motion._asdict(), "t": t}
    return vector_fields(
        **{name: part[order] for name, part in parts.items() if part is not None},
        validity=np.where(measured, Validity.VALID, Validity.INVALID)[order],
        length_unit=length,
        time_unit=time_unit,
        velocity_unit=velocity_unit,
        y_down=True if trackpy else None,
        facts={"track_window": str(window)} if "u" not in found else {},
    )


def column_names(header: str) -> tuple[dict[str, int], dict[str, str]]:
    """Index and unit of the known columns of a header line."""
    return _known(_split(header))


def unit_in(header: str) -> str | None:
    """The first text in brackets of a header line."""
    found = _BRACKETS.search(header)
    return found[1] if found else None


def _split(line: str) -> list[str]:
    delimiter = max(",;\t", key=line.count)
    try:
        return next(csv.reader([line.strip()], delimiter=delimiter), [])
    except csv.Error:  # no header: a quoted cell of more than 131,072 characters
        return []


def _known(names: list[str]) -> tuple[dict[str, int], dict[str, str]]:
    """Index and unit of the columns that the reader uses."""
    found: dict[str, int] = {}
    units: dict[str, str] = {}
    for i, text in enumerate(names):
        match = _COLUMN.fullmatch(text.strip())
        if match is None:
            continue
        for name, spellings in NAMES.items():
            if match[1].strip().lower() in spellings and name not in found:
                found[name] = i
                if match[2]:
                    units[name] = match[2]
    return found, units


def _read_csv(path: Path) -> tuple[list[str], Float64]:
    text = TextFile(path)
    header = text.head(1)[0]
    names = _split(header)
    if len(names) > MAX_COLUMNS:
        raise DataFileError(
            f"{path} must have at most {MAX_COLUMNS} columns, got {len(names)}: export it again"
        )
    known, _ = _known(names)
    # Columns that the reader ignores may hold text; empty cells are NaN.
    delimiter = max(",;\t", key=header.count)
    keep = sorted(known.values())
    rows = Rows(path)
    reader = csv.reader(text.lines(1), delimiter=delimiter)
    try:
        for cells in reader:
            if not cells:
                continue
            if len(cells) != len(names):
                raise DataFileError(
                    f"{path}, line {reader.line_num + 1}: expected {len(names)} cells as in the "
                    f"header, got {len(cells)}: the file was cut off; export it again"
                )
            rows.add(reader.line_num + 1, [cells[i].strip() or "nan" for i in keep])
    except csv.Error as error:  # such as a quoted cell that never ends
        raise DataFileError(
            f"{path}, line {reader.line_num + 1}: expected cells of a table, got another text "
            f"({error}): export it again"
        ) from None
    return [names[i] for i in keep] + _unknown(names, keep), rows.table()


def _unknown(names: list[str], keep: list[int]) -> list[str]:
    """Names of the other columns, which identify trackpy."""
    return [name for i, name in enumerate(names) if i not in keep]


def _has_tables(path: Path) -> bool:
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            return bool(_tables(file))
    except UnsafeFileError:
        return False


def _tables(file: SafeFile) -> list[Dataset]:
    """The pandas tables that lie in this file, in the natural order of their frames."""
    found = []
    for name in sorted(file.names(), key=_frame_number):
        table = file.open_dataset(f"{name}/table") if file.is_group(name) else None
        if table is not None and table.is_table:
            found.append(table)
    return found


def _frame_number(name: str) -> list[tuple[int, str]]:
    """Key that sorts Frame_9 before Frame_10, without integers of any length."""
    digits = [text.lstrip("0") for text in _DIGITS.findall(name)]
    return [(len(text), text) for text in digits]


def _read_hdf5(path: Path) -> tuple[list[str], Float64]:
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            parts = [_columns(table) for table in _tables(file)]
    except UnsafeFileError as error:
        raise DataFileError(f"{path} cannot be read as HDF5: {error}") from None
    except (ValueError, LookupError, ArithmeticError):  # of the list of columns
        raise DataFileError(f"{path} cannot be read as HDF5: copy or make it again") from None
    parts = [part for part in parts if part]
    if not parts:
        raise DataFileError(f"{path} holds no tables of pandas: write it with PandasHDFStore")
    names = list(parts[0])
    if any(set(part) != set(names) for part in parts):
        raise DataFileError(f"{path} must have the same columns in every frame: write it again")
    columns = [np.concatenate([part[name] for part in parts]) for name in names]
    return names, np.stack(columns, axis=1)


def _columns(table: Dataset) -> dict[str, Float64]:
    """Columns of a pandas table: single ones, and blocks whose names an attribute lists."""
    rows = table.read()
    found: dict[str, Float64] = {}
    for field in rows.dtype.names or ():
        block = rows[field]
        if field == "index" or block.dtype.kind not in "fiu":
            continue
        if block.ndim == 1 and not field.startswith("values_block"):
            found[field] = block.astype(np.float64)
            continue
        names = _listed(table.attributes.content(f"{field}_kind") or b"")
        columns = block.reshape(len(rows), -1).T
        if len(names) != len(columns):
            raise UnsafeFileError(
                f"{field} must have a name for each of its {len(columns)} columns, got "
                f"{len(names)}: write it again"
            )
        for name, column in zip(names, columns, strict=True):
            found[name] = column.astype(np.float64)
    return found


def _listed(content: bytes) -> list[str]:
    """The strings of a pickled list of strings, read as data: nothing is unpickled."""
    operations = pickletools.genops(content)
    return [str(arg) for code, arg, _ in operations if code.name in _TEXT_OPCODES]
