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

from granpinn.importers.grids import PIVLAB_TYPES, codes_of
from granpinn.importers.limits import read_file
from granpinn.importers.vectors import (
    CALIBRATION,
    GAPS,
    DataFileError,
    VectorFields,
    split_gaps,
)

Matlab = dict[str, Any]  # variables, as granpinn.foreign.matlab gives them
VECTORS = ("u", "v", "typevector")
KINDS = ("_filtered", "_original", "")  # the first that a frame has
NAMES = (
    *("x", "y", "calxy", "caluv", "calu", "calv", "units", "displacement_only"),
    *(f"{name}{kind}" for kind in KINDS for name in VECTORS),
)


def read(path: Path) -> VectorFields:
    """All frames of a file; see the module for the layouts."""
    file = read_file("matlab", path, names=NAMES)
    frames = _frames(path, file)
    x, y, *_, types = frames[0]
    for k, frame in enumerate(frames):
        alike = all(
            isinstance(part, np.ndarray) and part.ndim == 2 and part.shape == np.shape(x)
            for part in frame[: 5 if types is not None else 4]
        )
        grid = alike and np.array_equal(frame[0], x) and np.array_equal(frame[1], y)
        if not grid or (frame[4] is None) != (types is None):
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
    facts = {name: f"{_number(path, file, name, 0):g}" for name in CALIBRATION if name in file}
    if types is None:
        facts["mask"] = GAPS
        codes = split_gaps(np.isfinite(u) & np.isfinite(v))
    else:
        types = np.stack([frame[4] for frame in frames])
        codes = codes_of(path, "vector type", types, PIVLAB_TYPES)
    length, velocity = _units(path, file)
    return VectorFields(
        t=np.arange(len(frames)),
        y=y[:, 0],
        x=x[0],
        u=u,
        v=v,
        validity=codes,
        length_unit=length,
        time_unit="frame",
        velocity_unit=velocity,
        y_down=bool(y[-1, 0] > y[0, 0]),
        facts=facts,
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


def _frames(path: Path, file: Matlab) -> list[tuple[Any, ...]]:
    """x, y, u, v and the types, or None, of every analyzed frame."""
    cells = [[_cells(file, name + kind) for name in VECTORS] for kind in KINDS]
    x, y = _cells(file, "x"), _cells(file, "y")
    if len(x) != len(y) or not any(columns[0] for columns in cells):
        raise DataFileError(
            f"{path} must hold x and y of every frame and u, v or u_original, as PIVlab saves "
            "them: export the vectors from PIVlab as a MATLAB file"
        )
    frames = []
    for k in range(len(x)):
        for columns in cells:
            parts = [column[k] if k < len(column) else None for column in columns]
            if isinstance(parts[0], np.ndarray) and parts[0].size > 1:
                frames.append((x[k], y[k], *parts))
                break
    if not frames:
        raise DataFileError(f"{path} holds no analyzed frame: analyze the images in PIVlab first")
    return frames


def _units(path: Path, file: Matlab) -> tuple[str, str]:
    """Units of an export: calibrated values are in meters already."""
    position = _number(path, file, "calxy", 1.0)
    velocity = _number(path, file, "caluv", _number(path, file, "calu", 1.0))
    if position == 1 and abs(velocity) == 1:
        return "px", "px/frame"
    displacement = _number(path, file, "displacement_only", 0.0) == 1
    per_frame = displacement or "m/frame" in str(file.get("units"))
    return "m", "m/frame" if per_frame else "m/s"
