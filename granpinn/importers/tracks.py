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

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers.columns import (
    GROUPS,
    NAMES,
    TextTable,
    chosen,
    column,
    header,
    in_one_unit,
    read_headed,
    require,
    require_finite,
)
from granpinn.importers.limits import read_file
from granpinn.importers.tracking import TrackMotion, counted, velocities
from granpinn.importers.vectors import (
    TRACK_WINDOW,
    DataFileError,
    Validity,
    VectorFields,
    vector_fields,
)

_TRACKPY = {"mass", "ecc", "raw_mass", "signal", "size"}


def sniff(path: Path, head: bytes) -> bool:
    """A header line with x, y and frame or t; or the tables of pandas in HDF5."""
    if head.startswith(b"\x89HDF"):
        hdf5 = path.suffix.lower() in (".h5", ".hdf5", ".hdf")
        with suppress(DataFileError):
            return hdf5 and bool(read_file("tracks", path, columns=False))
        return False
    lines = head.decode("utf-8", "replace").lstrip("\ufeff").splitlines() or [""]
    names = {column.name for column in header(lines[0])}
    x, y, frame, t = (names.intersection(NAMES[role]) for role in ("x", "y", "frame", "t"))
    return bool(x and y and (frame or t))


def read(path: Path, window: int = 5) -> VectorFields:
    """Scattered vectors of all tracks.

    Args:
        window: frames of the local polynomial, an odd number; not used if the table has u, v.
    """
    with path.open("rb") as stream:
        hdf5 = stream.read(8) == b"\x89HDF\r\n\x1a\n"
    table = _read_hdf5(path) if hdf5 else read_headed(path, ("x", "y"))
    found, stated = table.columns, table.units
    missing = [] if {"frame", "t"} & found.keys() else ["frame (or t)"]
    missing += [] if "particle" in found or {"u", "v"} <= found.keys() else ["particle (or u, v)"]
    require(path, table.named, missing)
    trackpy = len(_TRACKPY.intersection(column.name for column in table.named)) >= 2
    require_finite(path, found, nan=True)
    if trackpy and not stated.keys() & GROUPS["length_unit"]:
        stated = stated | {"x": "px"}
    columns, units, facts = in_one_unit(path, found, stated)
    timed = "t" in found
    t = columns["t" if timed else "frame"]
    units["time_unit"] = units["time_unit"] if timed else "frame"
    if "u" in found and "v" in found:
        motion = TrackMotion(columns["x"], columns["y"], columns["u"], columns["v"])
        motion = motion._replace(sigma_u=columns.get("sigma_u"), sigma_v=columns.get("sigma_v"))
    else:
        count = columns["frame"] if "frame" in found else counted(t, columns["particle"])
        motion = velocities(
            t, count, columns["x"], columns["y"], columns["particle"], columns.get("ep"), window
        )
        known = (units["length_unit"], units["time_unit"])
        units["velocity_unit"] = None if None in known else "/".join(map(str, known))
        facts |= {TRACK_WINDOW: str(window)}
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
        **units,
        y_down=True if trackpy else None,
        facts=facts,
    )


def _read_hdf5(path: Path) -> TextTable:
    stored = read_file("tracks", path)
    if not stored:
        raise DataFileError(f"{path} holds no tables of pandas: write it with PandasHDFStore")
    named = [column(name) for name in stored]
    places, stated = chosen(path, named, NAMES, ("x", "y"))
    values = [*stored.values()]
    return TextTable({role: values[i] for role, i in places.items()}, stated, tuple(named))
