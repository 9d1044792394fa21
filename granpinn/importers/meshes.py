"""VTK files (.vtk, .vti, .vtr, .vts, .vtu, .vtp) and OpenFOAM, through pyvista.

Cells that form a full grid become a grid. Others, such as a quadtree, become scattered vectors at
the cell centers. The velocity is a vector (U, velocity, velocity_vectors, u.x), the volume fraction
and the pressure scalars; --fields names others. Only flat meshes: one layer of cells in z, or one
plane of points. Times come from the case or the field data TimeValue.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.foreign import installed
from granpinn.importers.gaps import split_gaps
from granpinn.importers.limits import read_file
from granpinn.importers.mesh_files import check_files
from granpinn.importers.tables import to_grid
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, vector_fields

FRACTION = re.compile(r"alpha\..*|f|c|phi|volume_fraction|VOF", re.IGNORECASE)
PRESSURE = re.compile(r"p|pressure")
_XML = (b"<?xml", b"<VTKFile")


def sniff(path: Path, head: bytes) -> bool:
    """VTK by content, OpenFOAM by its folder."""
    if path.is_dir():
        return (path / "system" / "controlDict").is_file()
    return head.startswith(b"# vtk DataFile") or (head.startswith(_XML) and b"<VTKFile" in head)


def read(path: Path, names: dict[str, str] | None = None) -> VectorFields:
    """All times of a file or case.

    Args:
        names: of the fields u (a vector), c and p, if they are not the usual ones.
    """
    if not installed("pyvista"):
        raise DataFileError(
            f"{path} is VTK or OpenFOAM, which needs pyvista: pip install 'granpinn[mesh]'"
        )
    named = names or {}
    meshes = read_file("mesh", path, check_files, velocity=named.get("u"))
    frames = [(mesh["time"], _frame(path, mesh, named)) for mesh in meshes]
    if not frames:
        raise DataFileError(f"{path} holds no time with a velocity: check the case")
    timed = all(t is not None for t, _ in frames)
    times = [float(t) if timed and t is not None else float(k) for k, (t, _) in enumerate(frames)]
    if any(columns.keys() != frames[0][1].keys() for _, columns in frames):
        raise DataFileError(f"{path} must hold the same fields at all times: write it again")
    gridded = [_gridded(path, columns) for _, columns in frames]
    others: dict[str, Any] = {"time_unit": "s" if timed else "frame", "y_down": False}
    if any(grid is None for grid in gridded):
        return _scattered(times, [columns for _, columns in frames], others)
    return _stacked(path, times, gridded, others)


def _frame(path: Path, frame: dict[str, Any], names: dict[str, str]) -> dict[str, Any]:
    """x, y, u, v of one mesh [n], and c and p if it has them."""
    if "velocity" not in frame:
        raise DataFileError(
            f"{path} must hold one velocity, got {', '.join(frame['names'])}: name it with "
            "--fields u=NAME"
        )
    centers, velocity = frame["points"], frame["velocity"]
    if not np.isfinite(centers).all():
        raise DataFileError(
            f"{path} must have finite coordinates, got nan or inf in "
            f"{int((~np.isfinite(centers)).any(axis=1).sum())} of {len(centers)} cells: export it "
            "again"
        )
    layers = np.unique(np.round((centers[:, 2] - centers[0, 2]) / (np.ptp(centers) or 1), 6))
    if layers.size > 2:
        raise DataFileError(
            f"{path} must be flat, got {layers.size} layers in z: cut a plane out of it first"
        )
    kept = centers[:, 2] <= centers[:, 2].min() + 1e-6 * (np.ptp(centers) or 1)
    columns = {"x": centers[:, 0], "y": centers[:, 1], "u": velocity[:, 0], "v": velocity[:, 1]}
    data = frame["scalars"]
    for role, usual in (("c", FRACTION), ("p", PRESSURE)):
        found = [name for name in data if _is(name, names.get(role), usual)]
        if len(found) > 1 or (not found and role in names):
            raise DataFileError(
                f"{path} must hold one field {names.get(role, role)}, got "
                f"{', '.join(found or data)}: name it with --fields {role}=NAME"
            )
        if found:
            columns[role] = data[found[0]].astype(np.float64)
    return {name: values[kept] for name, values in columns.items()}


def _is(name: str, wanted: str | None, pattern: re.Pattern[str]) -> bool:
    return name == wanted if wanted is not None else bool(pattern.fullmatch(name))


def _gridded(path: Path, columns: dict[str, Any]) -> dict[str, Any] | None:
    """The frame as a grid, None if its cells form none."""
    finite = np.isfinite(columns["u"] + columns["v"])
    try:
        grid = to_grid(path, columns, np.where(finite, Validity.VALID, Validity.MASKED))
    except DataFileError:
        return None
    if "c" not in columns:
        grid["validity"] = split_gaps(np.isfinite(grid["u"] + grid["v"]))
    return grid


def _stacked(path: Path, times: list[float], grids: Any, others: dict[str, Any]) -> VectorFields:
    first = grids[0]
    for grid in grids[1:]:
        if not (np.array_equal(grid["x"], first["x"]) and np.array_equal(grid["y"], first["y"])):
            raise DataFileError(f"{path} must have one grid at all times, got another: resample it")
    names = [name for name in first if name not in ("x", "y")]
    stacked = {name: np.concatenate([grid[name] for grid in grids]) for name in names}
    return vector_fields(t=times, y=first["y"], x=first["x"], **stacked, **others)


def _scattered(times: list[float], frames: Any, others: dict[str, Any]) -> VectorFields:
    joined = {name: np.concatenate([frame[name] for frame in frames]) for name in frames[0]}
    t = np.repeat(times, [frame["x"].size for frame in frames])
    return vector_fields(t=t, **joined, **others)
