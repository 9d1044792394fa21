"""Meshes of VTK and cases of OpenFOAM, by pyvista; `importers/mesh_files.py` checks their files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyvista

from granpinn.foreign.program import Answer

LIBRARY = "pyvista"
VELOCITY = ("U", "velocity", "velocity_vectors", "u.x", "u", "Velocity", "v")


def read(path: Path, answer: Answer, velocity: str | None) -> list[dict[str, Any]]:
    """For each time: `time`, `points` [n, 3], `velocity` [n, 2 or 3], and `scalars` [n] by name;
    `names` of all data if there is no velocity, or of all velocities if there are several."""
    names = [velocity] if velocity else VELOCITY
    return [_frame(t, mesh, names, answer) for t, mesh in _meshes(path)]


def _meshes(path: Path) -> Iterator[tuple[float | None, Any]]:
    """Pairs of time (or None) and mesh."""
    if path.is_dir():
        decomposed = any(path.glob("processor*")) and not (path / "constant/polyMesh").exists()
        kind = pyvista.POpenFOAMReader if decomposed else pyvista.OpenFOAMReader
        reader = kind(str(path / "system" / "controlDict"))
        for t in reader.time_values:
            reader.set_active_time_value(t)
            yield float(t), reader.read()
        return
    mesh = pyvista.read(str(path))
    value = mesh.field_data.get("TimeValue") if hasattr(mesh, "field_data") else None
    yield (None if value is None or len(value) != 1 else float(value[0])), mesh


def _frame(t: float | None, mesh: Any, velocity: Any, answer: Answer) -> dict[str, Any]:
    if hasattr(mesh, "keys") and hasattr(mesh, "combine"):  # blocks
        inner = next((name for name in mesh.keys() if name == "internalMesh"), None)  # noqa: SIM118
        mesh = mesh[inner] if inner else mesh.combine()
    for at_cells in (True, False):
        data = mesh.cell_data if at_cells else mesh.point_data
        vectors = [n for n in velocity if n in data and np.ndim(data[n]) == 2]
        vectors = [n for n in vectors if np.shape(data[n])[1] >= 2]
        if len(vectors) > 1:
            return {"time": t, "names": vectors}
        if vectors:
            scalars = {n: answer.keep(data[n]) for n in data if np.ndim(data[n]) == 1}
            points = mesh.cell_centers().points if at_cells else mesh.points
            return {
                "time": t,
                "points": answer.keep(np.array(points, np.float64)),
                "velocity": answer.keep(np.array(data[vectors[0]], np.float64)),
                "scalars": scalars,
            }
    return {"time": t, "names": [str(name) for name in (*mesh.cell_data, *mesh.point_data)]}
