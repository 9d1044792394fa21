"""PIVlab's MATLAB files, of version 5 to 7 and of version 7.3 (which is HDF5).

- one frame: matrices u, v, x, y, typevector, and calxy, caluv;
- all frames: cell arrays x, y, u_filtered, v_filtered, typevector_filtered and the same with
  `_original`, with calxy, calu, calv and `units`.

Filtered vectors are read if the file has them, but no smoothed ones: smoothing changes the strain
rate. Rows of the matrices run from the top of the image. Types as in the text exports.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers.grids import PIVLAB_TYPES
from granpinn.importers.limits import read_file
from granpinn.importers.vectors import (
    CALIBRATION,
    GAPS,
    DataFileError,
    Validity,
    VectorFields,
    split_gaps,
    vector_fields,
)

Matlab = dict[str, Any]  # variables, as granpinn.foreign.matlab gives them
NAMES = (
    *("x", "y", "u", "v", "typevector", "calxy", "caluv", "calu", "calv", "units"),
    *(f"{n}_{kind}" for n in ("u", "v", "typevector") for kind in ("original", "filtered")),
    "displacement_only",
)


def sniff(path: Path, head: bytes) -> bool:
    """Whether the file is of MATLAB; `read` checks its content."""
    return head.startswith(b"MATLAB") or (
        path.suffix.lower() == ".mat" and head.startswith(b"\x89HDF")
    )


def read(path: Path) -> VectorFields:
    """All frames of a file; see the module for the layouts."""
    file = read_file("matlab", path, names=NAMES)
    if "u_original" in file or "u_filtered" in file:
        return _all_frames(path, file)
    if all(name in file for name in ("x", "y", "u", "v")):
        frame = [file[name] for name in ("x", "y", "u", "v")]
        types = _cells(file, "typevector") or [None]
        return _fields(path, file, [(*frame, *types)], _units(path, file))
    raise DataFileError(
        f"{path} must hold x, y and u, v or u_original, as PIVlab saves them, got "
        "none of these: export the vectors from PIVlab as a MATLAB file"
    )


def _cells(file: Matlab, name: str) -> list[Any]:
    """The matrices of a cell array, or a single matrix; nothing if there is no such variable."""
    value = file.get(name, {"cells": []})
    return list(value["cells"]) if isinstance(value, dict) else [value]


def _number(path: Path, file: Matlab, name: str, default: float) -> float:
    value = file.get(name)
    if value is not None and not (isinstance(value, np.ndarray) and value.size == 1):
        raise DataFileError(
            f"{path}: {name} must be one number, got {np.size(value)}: export it again"
        )
    return default if value is None else float(value.item())


def _all_frames(path: Path, file: Matlab) -> VectorFields:
    cells = {
        kind: [_cells(file, f"{name}_{kind}") for name in ("u", "v", "typevector")]
        for kind in ("filtered", "original")
    }
    x, y = _cells(file, "x"), _cells(file, "y")
    if not x or len(x) != len(y):
        raise DataFileError(f"{path} must hold cells x and y for every frame: export it again")
    frames = []
    for k in range(len(x)):
        for kind in ("filtered", "original"):
            parts = [column[k] if k < len(column) else None for column in cells[kind]]
            if _is_field(parts[0]):
                frames.append((x[k], y[k], *parts))
                break
    return _fields(path, file, frames, _units(path, file))


def _is_field(part: Any) -> bool:
    return isinstance(part, np.ndarray) and part.size > 1


def _units(path: Path, file: Matlab) -> tuple[str, str]:
    """Units of an export: calibrated values are in meters already."""
    position = _number(path, file, "calxy", 1.0)
    velocity = _number(path, file, "caluv", _number(path, file, "calu", 1.0))
    if position == 1 and abs(velocity) == 1:
        return "px", "px/frame"
    displacement = _number(path, file, "displacement_only", 0.0) == 1
    per_frame = displacement or "m/frame" in str(file.get("units"))
    return "m", "m/frame" if per_frame else "m/s"


def _fields(
    path: Path,
    file: Matlab,
    frames: list[tuple[Any, ...]],
    units: tuple[str, str],
) -> VectorFields:
    if not frames:
        raise DataFileError(f"{path} holds no analyzed frame: analyze the images in PIVlab first")
    x, y = frames[0][:2]
    for k, frame in enumerate(frames):
        matrices = frame if frame[4] is not None else frame[:4]
        alike = all(
            isinstance(part, np.ndarray) and part.ndim == 2 and part.shape == np.shape(x)
            for part in matrices
        )
        grid = alike and np.array_equal(frame[0], x) and np.array_equal(frame[1], y)
        if not grid or (frame[4] is None) != (frames[0][4] is None):
            raise DataFileError(
                f"{path} must have matrices x, y, u, v of one size, one grid, and vector types in "
                f"all frames or in none, got something else in frame {k + 1}: export it again"
            )
    for name, values, axis in (("x", x, 0), ("y", y, 1)):
        if not (np.ptp(values, axis=axis) <= 1e-6 * np.ptp(values)).all():
            raise DataFileError(
                f"{path} must have one {name} in every {('column', 'row')[axis]}, got several: "
                "rotate nothing"
            )
    u, v = (np.stack([frame[i] for frame in frames]) for i in (2, 3))
    if frames[0][4] is None:
        facts = {"mask": GAPS}
        codes = split_gaps(np.isfinite(u) & np.isfinite(v))
    else:
        facts = {}
        types = np.stack([frame[4] for frame in frames])
        codes = np.full(u.shape, Validity.INVALID, np.int8)
        for kind, code in PIVLAB_TYPES.items():
            codes[types == kind] = code
    calibration = {name: _number(path, file, name, np.nan) for name in CALIBRATION}
    return vector_fields(
        t=np.arange(len(frames)),
        y=y[:, 0],
        x=x[0],
        u=u,
        v=v,
        validity=codes,
        length_unit=units[0],
        time_unit="frame",
        velocity_unit=units[1],
        y_down=bool(y[-1, 0] > y[0, 0]),
        facts={k: f"{n:g}" for k, n in calibration.items() if np.isfinite(n)} | facts,
    )
