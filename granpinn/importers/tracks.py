"""Tables of tracked particles (PTV): text, and HDF5 of trackpy's PandasHDFStore and of TracTrac.

Columns by name, in any order, units in brackets if at all, such as `x [mm]`:

- x, y; and frame, or t (time);
- particle (also id, track, trajectory): the number of the track; velocities then come from local
  polynomials over its frames;
- or u, v (also vx, vy): velocities of the tracking program, with sigma_u, sigma_v;
- ep: trackpy's uncertainty of the position.

trackpy counts in pixels and frames, with y down, and so does opyf (N, X, Y, Ux, Uy), with one file
for every frame. TracTrac's velocities are those of its table, in pixels and frames. trackpy's HDF5
is read without pandas, which would run foreign code to unpack the names of the columns.
"""

from __future__ import annotations

import pickletools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.data.hdf5 import SafeFile, open_hdf5
from granpinn.data.hdf5.dataset import Dataset
from granpinn.importers.columns import (
    GROUPS,
    HEADER_LINES,
    NAMES,
    TextTable,
    chosen,
    column,
    in_one_unit,
    layout_of,
    read_headed,
    require,
    require_finite,
)
from granpinn.importers.pivlab_text import FIRST_WORDS as PIVLAB
from granpinn.importers.textfile import MAX_BYTES, encoding_of
from granpinn.importers.tracking import TrackMotion, counted, velocities
from granpinn.importers.vectors import (
    TRACK_WINDOW,
    DataFileError,
    Validity,
    VectorFields,
    vector_fields,
)
from granpinn.regular import UnsafeFileError

_DIGITS = re.compile(r"\d++")
_OPYF = {"n", "x", "y", "ux", "uy"}  # of one frame, in pixels, y down
_TRACKPY = {"mass", "ecc", "raw_mass", "signal", "size"}
_TEXT_OPCODES = ("UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "STRING")


def sniff(path: Path, head: bytes) -> bool:
    """Names of x, y and frame or t, or opyf's, above numbers; or tables of particles in HDF5."""
    if head.startswith(b"\x89HDF"):
        return path.suffix.lower() in (".h5", ".hdf5", ".hdf") and _has_tables(path)
    lines = head.decode(encoding_of(head), "replace").splitlines() or [""]
    if lines[0].lstrip("\ufeff# ").startswith(PIVLAB):
        return False
    named = layout_of(lines[:HEADER_LINES], NAMES, ("x", "y")).named
    names = {column.name for column in named}
    x, y, frame, t = (names.intersection(NAMES[role]) for role in ("x", "y", "frame", "t"))
    return bool(x and y and (frame or t)) or names == _OPYF


def read(
    path: Path,
    window: int = 5,
    columns: Mapping[str, str] | None = None,
    drop_duplicates: bool = False,
) -> VectorFields:
    """Scattered vectors of all tracks.

    Args:
        window: frames of the local polynomial, an odd number; not used if the table has u, v.
        columns: names of the columns by their roles, where they are not in `NAMES`.
        drop_duplicates: keep the first of several rows of one particle in one frame.
    """
    with path.open("rb") as stream:
        hdf5 = stream.read(8) == b"\x89HDF\r\n\x1a\n"
    roles = NAMES | {role: (column(name).name,) for role, name in (columns or {}).items()}
    table = _read_hdf5(path) if hdf5 else read_headed(path, ("x", "y"), roles)
    found, stated = table.columns, table.units
    names = {column.name for column in table.named}
    opyf = names == _OPYF
    if opyf:  # one frame each
        found = found | {"frame": np.zeros_like(found["x"])}
    missing = [] if {"frame", "t"} & found.keys() else ["frame (or t)"]
    missing += [] if "particle" in found or {"u", "v"} <= found.keys() else ["particle (or u, v)"]
    require(path, table.named, missing)
    trackpy = len(_TRACKPY & names) >= 2
    require_finite(path, found, nan=True)
    if (trackpy or opyf) and not stated.keys() & GROUPS["length_unit"]:
        stated = stated | {"x": "px"}
    if (opyf or "TracTrac" in table.comment) and not stated.keys() & GROUPS["velocity_unit"]:
        stated = {"x": "px"} | stated | {"u": "px/frame"}
    found, units, facts = in_one_unit(path, found, stated)
    timed = "t" in found
    units["time_unit"] = units["time_unit"] if timed else "frame"
    if "u" in found and "v" in found:
        t = found["t" if timed else "frame"]
        motion = TrackMotion(found["x"], found["y"], found["u"], found["v"])
        motion = motion._replace(sigma_u=found.get("sigma_u"), sigma_v=found.get("sigma_v"))
    else:
        found = _each_once(path, found, drop_duplicates)
        t = found["t" if timed else "frame"]
        ep = found.get("ep")
        ep = ep if ep is not None and np.isfinite(ep).any() else None
        count = found["frame"] if "frame" in found else counted(t, found["particle"])
        motion = velocities(t, count, found["x"], found["y"], found["particle"], ep, window)
        known = (units["length_unit"], units["time_unit"])
        units["velocity_unit"] = None if None in known else "/".join(map(str, known))
        facts |= {TRACK_WINDOW: str(window)}
    finite = np.asarray(np.isfinite([motion.x, motion.y, t]).all(axis=0))
    if not finite.any():
        raise DataFileError(f"{path} holds no particle with a position and a time: export it again")
    measured = np.isfinite(motion.u) & np.isfinite(motion.v)
    # The order of the rows in the file must not matter: equal vectors give equal flows.
    keys = [found.get("particle"), t]
    order = np.lexsort(
        [k for k in (motion.v, motion.u, motion.y, motion.x, *keys) if k is not None]
    )
    order = order[finite[order]]
    parts: dict[str, Any] = {**motion._asdict(), "t": t}
    return vector_fields(
        **{name: part[order] for name, part in parts.items() if part is not None},
        validity=np.where(measured, Validity.VALID, Validity.INVALID)[order],
        **units,
        y_down=True if trackpy or opyf else None,
        facts=facts,
    )


def _each_once(path: Path, columns: Mapping[str, Float64], drop: bool) -> dict[str, Float64]:
    """The columns with one row for each particle and time."""
    time = "frame" if "frame" in columns else "t"
    particle, frame = columns["particle"], columns[time]
    order = np.lexsort((frame, particle))
    again = (np.diff(particle[order]) == 0) & (np.diff(frame[order]) == 0)
    if again.any() and not drop:
        row = order[1:][again][0]
        raise DataFileError(
            f"{path} must have one row for every particle and {time}, got particle "
            f"{particle[row]:g} more than once at {time} {frame[row]:g}, and {int(again.sum())} "
            "such rows: give --drop-duplicates to keep the first row of each, or link the "
            "particles again"
        )
    kept = np.ones(particle.size, bool)
    kept[order[1:][again]] = False
    return {name: values[kept] for name, values in columns.items()}


def _has_tables(path: Path) -> bool:
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            return bool(_tables(file)) or {"Frame", "x", "u"} <= {*file.names()}
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


def _read_hdf5(path: Path) -> TextTable:
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            if {"Frame", "x", "u"} <= {*file.names()}:
                return _tractrac(file)
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
    named = [column(name) for name in names]
    places, stated = chosen(path, named, NAMES, ("x", "y"))
    columns = {
        role: np.concatenate([part[names[i]] for part in parts]) for role, i in places.items()
    }
    return TextTable(columns, stated, tuple(named))


def _tractrac(file: SafeFile) -> TextTable:
    """TracTrac's table: Frame [n], x and u [n, 2]. Its Id has 16 bits and repeats itself."""
    parts: dict[str, Any] = {}
    for name in ("Frame", "x", "u"):
        dataset = file.open_dataset(name)
        parts[name] = np.zeros(0) if dataset is None else dataset.read().astype(np.float64)
    frame, x, u = parts["Frame"], parts["x"], parts["u"]
    if frame.ndim != 1 or not x.shape == u.shape == (frame.size, 2):
        raise UnsafeFileError(
            f"Frame [n], x and u [n, 2] must fit together, got {list(frame.shape)}, "
            f"{list(x.shape)} and {list(u.shape)}: write them again"
        )
    columns = {"frame": frame, "x": x[:, 0], "y": x[:, 1], "u": u[:, 0], "v": u[:, 1]}
    named = tuple(column(name) for name in columns)
    return TextTable(columns, {}, named, comment="TracTrac")


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
        if len(set(names)) < len(names) or found.keys() & set(names):
            raise UnsafeFileError(f"{field} must name every column once: write it again")
        found |= dict(zip(names, columns.astype(np.float64), strict=True))
    return found


def _listed(content: bytes) -> list[str]:
    """The strings of a pickled list of strings, read as data: nothing is unpickled."""
    operations = pickletools.genops(content)
    return [str(arg) for code, arg, _ in operations if code.name in _TEXT_OPCODES]
