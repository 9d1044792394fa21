"""opyf's HDF5: vectors on a grid, scattered vectors, and the depths that give the free surface.

- on a grid: coordinates/T [T], X [X], Y [Y] from the top; variables/Ux, Uy [T, Y, X], where (0, 0)
  means no vector;
- scattered: time [T]; coordinates and velocities hold one [n, 2] for every time, named by the time
  as text;
- depths: coordinates/time [T], x [X]; variables/depth [T, X], the height of the surface in y.

The files state no units.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers.columns import TextTable, column
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.limits import hdf5_arrays
from granpinn.importers.vectors import DataFileError, VectorFields, vector_fields

_GRID = {"t": "coordinates/T", "y": "coordinates/Y", "x": "coordinates/X"}
_GRID |= {"u": "variables/Ux", "v": "variables/Uy"}
_DEPTHS = {"t": "coordinates/time", "x": "coordinates/x", "depth": "variables/depth"}


def sniff(path: Path, head: bytes) -> bool:
    """HDF5 with the axes of opyf."""
    if not head.startswith(b"\x89HDF"):
        return False
    with suppress(DataFileError):
        on_grid, depths = [_GRID[name] for name in "tyx"], [_DEPTHS[name] for name in "tx"]
        found = hdf5_arrays(path, *on_grid, *depths, "time")
        if found.keys() >= {*on_grid} or found.keys() >= {*depths}:
            return True
        times = found.get("time", np.zeros(0)).reshape(-1)
        return bool(times.size and hdf5_arrays(path, f"coordinates/{times.tolist()[0]}"))
    return False


def read(path: Path) -> VectorFields:
    """All frames of a file."""
    axes = hdf5_arrays(path, "time", _DEPTHS["t"])
    if "time" in axes:
        return _scattered(path, axes["time"].reshape(-1))
    if _DEPTHS["t"] in axes:
        raise DataFileError(
            f"{path} must hold velocities, got depths: give the velocity file of the run, "
            "and this one as --surface"
        )
    parts = _required(path, _GRID)
    y, u, v = parts["y"], parts["u"], parts["v"]
    there = np.isfinite(u) & np.isfinite(v) & ((u != 0) | (v != 0))
    if u.ndim != 3 or u.shape != v.shape or y.size < 2:
        raise DataFileError(
            f"{path} must hold Ux and Uy [T, Y, X], got {list(u.shape)} and {list(v.shape)}: "
            "export it again"
        )
    facts = {"vector_types": "no", "mask": GAPS}
    down = bool(y.flat[0] < y.flat[-1])
    return vector_fields(**parts, validity=split_gaps(there), y_down=down, facts=facts)


def _scattered(path: Path, times: Any) -> VectorFields:
    """The vectors of all times; a group has the name of its time."""
    pairs = {t: [f"{group}/{t}" for group in ("coordinates", "velocities")] for t in times.tolist()}
    found = _required(path, {name: name for pair in pairs.values() for name in pair})
    rows = []
    for t, names in pairs.items():
        place, velocity = (found[name] for name in names)
        if place.ndim != 2 or place.shape[1] != 2 or velocity.shape != place.shape:
            raise DataFileError(
                f"{path} must hold coordinates and velocities [n, 2] at the time {t:g}, got "
                f"{list(place.shape)} and {list(velocity.shape)}: export it again"
            )
        rows.append(np.column_stack([np.full(len(place), t), place, velocity]))
    t, x, y, u, v = np.concatenate(rows).T
    return vector_fields(t=t, x=x, y=y, u=u, v=v)


def read_depths(path: Path) -> TextTable | None:
    """The points t, x, y of the free surface: y is the depth, where there is one.

    None if the file holds something else than opyf's depths.
    """
    try:
        found = hdf5_arrays(path, *_DEPTHS.values())
    except DataFileError:
        return None
    if found.keys() != {*_DEPTHS.values()}:
        return None
    t, x, depth = (found[place] for place in _DEPTHS.values())
    if depth.shape != (t.size, x.size):
        raise DataFileError(
            f"{path} must hold depths [{t.size}, {x.size}] for its times and x, got "
            f"{list(depth.shape)}: export it again"
        )
    there = np.isfinite(depth) & (depth > 0)
    k, i = np.nonzero(there)
    columns = {"t": t.reshape(-1)[k], "x": x.reshape(-1)[i], "y": depth[there]}
    return TextTable(columns, {}, tuple(column(name) for name in columns))


def _required(path: Path, places: Mapping[str, str]) -> dict[str, Any]:
    """The arrays of these names, which must all be there."""
    found = hdf5_arrays(path, *places.values())
    for place in places.values():
        if place not in found:
            raise DataFileError(f"{path} must hold {place}, got no such dataset: export it again")
    return {name: found[place] for name, place in places.items()}
