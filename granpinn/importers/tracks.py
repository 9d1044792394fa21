"""Tables of tracked particles (PTV).

Columns by name, in any order, units in brackets if at all, such as `x [mm]`:

- x, y; and frame, or t (time);
- particle (also id, track, trajectory): the number of the track; velocities then come from local
  polynomials over its frames;
- or u, v (also vx, vy): velocities of the tracking program, with sigma_u, sigma_v;
- ep: trackpy's uncertainty of the position.

trackpy counts in pixels and frames, with y down, and so does opyf (N, X, Y, Ux, Uy), with one file
for every frame. In TrackMate's tables y is down in any unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers.columns import (
    GROUPS,
    HEADER_LINES,
    NAMES,
    column,
    layout_of,
    read_headed,
    require,
    require_finite,
    units_of,
)
from granpinn.importers.pivlab_text import FIRST_WORDS as PIVLAB
from granpinn.importers.textfile import encoding_of
from granpinn.importers.tracking import TrackMotion, counted, velocities
from granpinn.importers.vectors import (
    TRACK_WINDOW,
    DataFileError,
    Validity,
    VectorFields,
    vector_fields,
)

_OPYF = {"n", "x", "y", "ux", "uy"}  # of one frame, in pixels, y down
_TRACKPY = {"mass", "ecc", "raw_mass", "signal", "size"}


def sniff(path: Path, head: bytes) -> bool:
    """Names of x, y and frame or t, or opyf's, above numbers."""
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
) -> VectorFields:
    """Scattered vectors of all tracks.

    Args:
        window: frames of the local polynomial, an odd number; not used if the table has u, v.
        columns: names of the columns by their roles, where they are not in `NAMES`.
    """
    roles = NAMES | {role: (column(name).name,) for role, name in (columns or {}).items()}
    table = read_headed(path, ("x", "y"), roles)
    found, stated = table.columns, table.units
    names = {column.name for column in table.named}
    opyf = names == _OPYF
    if opyf:  # one frame each
        found = found | {"frame": np.zeros_like(found["x"])}
    missing = [] if {"frame", "t"} & found.keys() else ["frame (or t)"]
    missing += [] if "particle" in found or {"u", "v"} <= found.keys() else ["particle (or u, v)"]
    require(path, table.named, missing)
    image = opyf or len(_TRACKPY & names) >= 2
    down = image or "position_x" in names
    require_finite(path, found, nan=True)
    if image and not stated.keys() & GROUPS["length_unit"]:
        stated = stated | {"x": "px"}
    if opyf and not stated.keys() & GROUPS["velocity_unit"]:
        stated = stated | {"u": "px/frame"}
    units, facts = units_of(path, stated), {}
    timed = "t" in found
    units["time_unit"] = units["time_unit"] if timed else "frame"
    if "u" in found and "v" in found:
        t = found["t" if timed else "frame"]
        motion = TrackMotion(found["x"], found["y"], found["u"], found["v"])
        motion = motion._replace(sigma_u=found.get("sigma_u"), sigma_v=found.get("sigma_v"))
    else:
        _require_each_once(path, found)
        t = found["t" if timed else "frame"]
        ep = found.get("ep")
        ep = ep if ep is not None and np.isfinite(ep).any() else None
        count = found["frame"] if "frame" in found else counted(t, found["particle"])
        motion = velocities(t, count, found["x"], found["y"], found["particle"], ep, window)
        known = (units["length_unit"], units["time_unit"])
        units["velocity_unit"] = None if None in known else "/".join(map(str, known))
        facts = {TRACK_WINDOW: str(window)}
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
        y_down=True if down else None,
        facts=facts,
    )


def _require_each_once(path: Path, columns: Mapping[str, Float64]) -> None:
    """Refuses several rows for one particle and time."""
    time = "frame" if "frame" in columns else "t"
    particle, frame = columns["particle"], columns[time]
    order = np.lexsort((frame, particle))
    again = (np.diff(particle[order]) == 0) & (np.diff(frame[order]) == 0)
    if again.any():
        row = order[1:][again][0]
        raise DataFileError(
            f"{path} must have one row for every particle and {time}, got particle "
            f"{particle[row]:g} more than once at {time} {frame[row]:g}, and {int(again.sum())} "
            "such rows: link the particles again, or keep the first row of each"
        )
