"""The process in which foreign C++ libraries read files, a program that needs no other module.

VTK (through pyvista) and LaVision's lvpyio crash on some damaged files and allocate whatever a file
declares. Here they crash alone. The program takes the name of a library, reads one request a line,
JSON, and answers each with a length of 8 bytes and a .npz of arrays, in which `meta` is JSON:
`frames` or, if the file cannot be read, `error`.
"""

from __future__ import annotations

import io
import json
import os
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np

VELOCITY = ("U", "velocity", "velocity_vectors", "u.x", "u", "Velocity", "v")
READY = b"ready\n"


def main(library: str) -> None:
    """Answers requests until the input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    read = {"pyvista": read_mesh, "lvpyio": read_davis}[library]
    module = __import__(library)
    answers.write(READY)
    answers.flush()
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    for line in sys.stdin:
        request = json.loads(line)
        _limit_memory(used + request["max_bytes"])
        try:
            frames = read(module, request)
        except Exception as error:  # of any kind: the library is foreign
            reason = " ".join(f"{error}".split())[:160]
            content = _packed({"error": reason or type(error).__name__}, [])
        else:
            content = _packed({}, frames)
        answers.write(len(content).to_bytes(8, "little"))
        answers.write(content)
        answers.flush()


def _limit_memory(size: int) -> None:
    """Limit the address space to `size` bytes; a limit of the user (`ulimit -v`) stays in force."""
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    limit = size if most == resource.RLIM_INFINITY else min(size, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit, most))


def _packed(meta: dict[str, Any], frames: list[dict[str, Any]]) -> memoryview:
    """The arrays of all frames, as "INDEX/NAME", and everything else in `meta`."""
    arrays: dict[str, Any] = {}
    values = []
    for i, frame in enumerate(frames):
        own = {name for name, value in frame.items() if isinstance(value, np.ndarray)}
        arrays |= {f"{i}/{name}": frame[name] for name in own}
        values.append({name: value for name, value in frame.items() if name not in own})
    content = io.BytesIO()
    text = json.dumps({**meta, "frames": values}).encode()
    np.savez(content, meta=np.frombuffer(text, np.uint8), **arrays)
    return content.getbuffer()


def read_mesh(pyvista: Any, request: dict[str, Any]) -> list[dict[str, Any]]:
    """For each time: `time`, `points` [n, 3], `velocity` [n, 2 or 3], and scalars `data/NAME` [n];
    `names` of all data if there is no velocity, or of all velocities if there are several."""
    path = Path(request["path"])
    velocity = [request["velocity"]] if request["velocity"] else VELOCITY
    return [_mesh_frame(t, mesh, velocity) for t, mesh in _meshes(pyvista, path)]


def _meshes(pyvista: Any, path: Path) -> Any:
    """Pairs of time (or None) and mesh."""
    if path.is_dir() or path.suffix.lower() in (".foam", ".pvd"):
        if path.is_dir():
            decomposed = any(path.glob("processor*")) and not (path / "constant/polyMesh").exists()
            kind = pyvista.POpenFOAMReader if decomposed else pyvista.OpenFOAMReader
            reader = kind(str(path / "system" / "controlDict"))
        else:
            reader = pyvista.get_reader(str(path))
        for t in reader.time_values:
            reader.set_active_time_value(t)
            yield float(t), reader.read()
        return
    mesh = pyvista.read(str(path))
    value = mesh.field_data.get("TimeValue") if hasattr(mesh, "field_data") else None
    yield (None if value is None or len(value) != 1 else float(value[0])), mesh


def _mesh_frame(t: float | None, mesh: Any, velocity: Any) -> dict[str, Any]:
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
            scalars = {n: data[n] for n in data if np.ndim(data[n]) == 1}
            points = mesh.cell_centers().points if at_cells else mesh.points
            return {
                "time": t,
                "names": [*scalars],
                "points": np.array(points, np.float64),
                "velocity": np.array(data[vectors[0]], np.float64),
                **{f"data/{k}": np.array(v) for k, v in enumerate(scalars.values())},
            }
    return {"time": t, "names": [str(name) for name in (*mesh.cell_data, *mesh.point_data)]}


def read_davis(lvpyio: Any, request: dict[str, Any]) -> list[dict[str, Any]]:
    """For each buffer: u, v, enabled, choice, mask [Y, X], sigma_u, sigma_v if there are any,
    scales and attributes; `image` if it holds no vectors."""
    path = Path(request["path"])
    if path.suffix.lower() == ".set":
        with lvpyio.read_set(str(path)) as buffers:
            return [_davis_frame(buffer) for buffer in buffers]
    return [_davis_frame(lvpyio.read_buffer(str(path)))]


def _davis_frame(buffer: Any) -> dict[str, Any]:
    if len(buffer) != 1:
        raise ValueError(f"a buffer holds {len(buffer)} frames, export one vector field a file")
    frame = buffer[0]
    if not hasattr(frame, "as_masked_array") or "U0" not in frame.components:
        return {"image": True}
    vectors, scales, grid = frame.as_masked_array(), frame.scales, frame.grid
    found: dict[str, Any] = {
        "u": np.array(vectors["u"].filled(np.nan)),
        "v": np.array(vectors["v"].filled(np.nan)),
        "enabled": np.asarray(frame.enabled[0], bool),
        "choice": np.asarray(frame.active_choice[0]),
        "mask": np.asarray(frame.masks[0], bool),
        **{"x_slope": float(scales.x.slope), "x_offset": float(scales.x.offset)},
        **{"y_slope": float(scales.y.slope), "y_offset": float(scales.y.offset)},
        **{"x_step": float(grid.x), "y_step": float(grid.y)},
        "units": {"x": str(scales.x.unit), "y": str(scales.y.unit), "u": str(scales.i.unit)},
        "acquired": str(frame.attributes.get("AcqTimeSeries", "")),
        "frame_dt": str(frame.attributes.get("FrameDt", "")),
    }
    names = [f"TS:Uncertainty V{axis}" for axis in "xy"]
    if all(name in frame.components for name in names):
        for name, target in zip(names, ("sigma_u", "sigma_v"), strict=True):
            component = frame.components[name]
            found[target] = np.asarray(component[0], np.float64) * component.scale.slope
            found["units"][target] = str(getattr(component.scale, "unit", ""))
    return found


if __name__ == "__main__":
    main(sys.argv[1])
