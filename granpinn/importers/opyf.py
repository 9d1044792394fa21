"""opyf's HDF5: vectors on a grid, scattered vectors, and the depths that give the free surface.

- on a grid: coordinates/T [T], X [X], Y [Y] from the top; variables/Ux, Uy [T, Y, X], where (0, 0)
  means no vector;
- scattered: time [T]; coordinates and velocities hold one [n, 2] for every time, named by the time
  as text;
- depths: coordinates/time [T], x [X]; variables/depth [T, X], the height of the surface in y.

The files state no units.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from granpinn.data.hdf5 import SafeFile, open_hdf5
from granpinn.importers.columns import TextTable, column
from granpinn.importers.gaps import GAPS, split_gaps
from granpinn.importers.textfile import MAX_BYTES
from granpinn.importers.vectors import DataFileError, VectorFields, vector_fields
from granpinn.regular import UnsafeFileError

_GRID = {"t": "coordinates/T", "y": "coordinates/Y", "x": "coordinates/X"}
_GRID |= {"u": "variables/Ux", "v": "variables/Uy"}
_DEPTHS = {"t": "coordinates/time", "x": "coordinates/x", "depth": "variables/depth"}


def sniff(path: Path, head: bytes) -> bool:
    """HDF5 with the groups of opyf."""
    if not head.startswith(b"\x89HDF"):
        return False
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            groups = {name for name in file.names() if file.is_group(name)}
    except UnsafeFileError:
        return False
    return "coordinates" in groups and bool({"variables", "velocities"} & groups)


def read(path: Path) -> VectorFields:
    """All frames of a file."""
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            if file.holds("velocities"):
                return _scattered(path, file)
            if file.open_dataset(_DEPTHS["depth"]) is not None:
                raise DataFileError(
                    f"{path} must hold velocities, got depths: give the velocity file of the run, "
                    "and this one as --surface"
                )
            parts = {name: _array(path, file, place) for name, place in _GRID.items()}
    except UnsafeFileError as error:
        raise DataFileError(f"{path} cannot be read as HDF5: {error}") from None
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


def _scattered(path: Path, file: SafeFile) -> VectorFields:
    """The vectors of all times; a group has the name of its time."""
    times = _array(path, file, "time").reshape(-1)
    rows = []
    for t in times.tolist():
        place, velocity = (_array(path, file, f"{g}/{t}") for g in ("coordinates", "velocities"))
        if place.ndim != 2 or place.shape[1] != 2 or velocity.shape != place.shape:
            raise DataFileError(
                f"{path} must hold coordinates and velocities [n, 2] at the time {t:g}, got "
                f"{list(place.shape)} and {list(velocity.shape)}: export it again"
            )
        rows.append(np.column_stack([np.full(len(place), t), place, velocity]))
    t, x, y, u, v = np.concatenate(rows).T
    return vector_fields(t=t, x=x, y=y, u=u, v=v)


def is_depths(path: Path) -> bool:
    """Whether a file holds opyf's depths."""
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            return file.open_dataset(_DEPTHS["depth"]) is not None
    except UnsafeFileError:
        return False


def read_depths(path: Path) -> TextTable:
    """The points t, x, y of the free surface: y is the depth, where there is one."""
    try:
        with open_hdf5(path, MAX_BYTES) as file:
            parts = {name: _array(path, file, place) for name, place in _DEPTHS.items()}
    except UnsafeFileError as error:
        raise DataFileError(f"{path} cannot be read as HDF5: {error}") from None
    t, x, depth = parts["t"], parts["x"], parts["depth"]
    if depth.shape != (t.size, x.size):
        raise DataFileError(
            f"{path} must hold depths [{t.size}, {x.size}] for its times and x, got "
            f"{list(depth.shape)}: export it again"
        )
    there = np.isfinite(depth) & (depth > 0)
    k, i = np.nonzero(there)
    columns = {"t": t.reshape(-1)[k], "x": x.reshape(-1)[i], "y": depth[there]}
    return TextTable(columns, {}, tuple(column(name) for name in columns))


def _array(path: Path, file: SafeFile, name: str) -> Any:
    dataset = file.open_dataset(name)
    if dataset is None:
        raise DataFileError(f"{path} must hold {name}, got no such dataset: export it again")
    return dataset.read().astype(np.float64)
