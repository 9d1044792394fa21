"""Walls from a table: points in order, a row of nan between two pieces."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from granpinn.arrays import Float64
from granpinn.data.flow import Walls
from granpinn.importers import units
from granpinn.importers.frame import Frame
from granpinn.importers.textfile import TextFile
from granpinn.importers.vectors import LARGEST, DataFileError

COLUMNS = ("x", "y", "t", "u", "v", "slip", "p", "tau")
DIMENSIONS = {"x": "length", "y": "length", "t": "time", "u": "velocity", "v": "velocity"}
_COMMAS = str.maketrans(";\t", ",,")
_COLUMN = re.compile(r"(\w+)\s*(?:[\[(]([^\])]*)[\])])?")


def from_table(path: Path, frame: Frame, rate: float | None) -> Walls:
    """The walls of a CSV file with the columns x, y, and t, u, v, slip, p, tau where known.

    A column with a unit in brackets is in that unit; the others have the units of the vectors.
    p and tau have the unit of pressure of the flow file.

    Args:
        frame: of the vectors, in whose axes the points are given.
        rate: seconds per frame, or None.

    Raises:
        DataFileError: the file is no such table.
    """
    text = TextFile(path)
    head = text.head(1)[0]
    cells = [_COLUMN.fullmatch(cell.strip()) for cell in head.translate(_COMMAS).split(",")]
    names = [cell[1].lower() if cell else "" for cell in cells]
    found_units = {name: cell[2] for name, cell in zip(names, cells, strict=True) if cell}
    if not {"x", "y"} <= set(names) <= set(COLUMNS) or len(set(names)) < len(names):
        raise DataFileError(
            f"{path} must have a first line with the columns x, y and any of t, u, v, slip, p, "
            f"tau, got {head[:60]!r}: name the columns so"
        )
    table = text.numbers(1)
    if table.shape[1] != len(names):
        raise DataFileError(
            f"{path} must have the {len(names)} columns of its first line, got {table.shape[1]}: "
            "export it again"
        )
    columns = {name: table[:, k] for k, name in enumerate(names)}
    for name, values in columns.items():
        if np.isinf(values).any() or (np.abs(values) > LARGEST).any():
            raise DataFileError(
                f"{path} must have a {name} of at most {LARGEST:g}, or nan between two pieces, got "
                f"{values[np.abs(values) > LARGEST][0]:g}: leave this point out"
            )
    for name in ("x", "y", "u", "v"):
        if found_units.get(name) and name in columns:
            own = frame.length if name in "xy" else frame.velocity
            columns[name] = columns[name] * (_factor(path, name, found_units[name], frame) / own)
    x, y = frame.place(columns["x"], columns["y"])
    return Walls(
        x=x,
        y=y,
        t=_times(path, columns.get("t"), found_units.get("t"), frame, rate),
        u=_scaled(columns.get("u"), frame.velocity),
        v=_scaled(columns.get("v"), frame.up * frame.velocity),
        slip=_single(columns.get("slip")),
        p=_single(columns.get("p")),
        tau=_single(columns.get("tau")),
    )


def _factor(path: Path, name: str, unit: str, frame: Frame) -> float:
    """SI units in one unit of a column."""
    what = f"{path}: {name}"
    return units.factor(unit, DIMENSIONS[name], what, frame.pixel, frame.delay)


def _times(
    path: Path, t: Float64 | None, unit: str | None, frame: Frame, rate: float | None
) -> Float64 | None:
    if t is None or not unit:
        return None if t is None else frame.times(t)
    return t * units.factor(unit, "time", f"{path}: t", frame=rate)


def _scaled(values: Float64 | None, factor: float) -> Float64 | None:
    return None if values is None else values * factor


def _single(values: Float64 | None) -> np.ndarray | None:
    return None if values is None else values.astype(np.float32)
