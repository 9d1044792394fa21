"""Points of the free surface and of walls, from tables and arrays, in the axes of the vectors.

A column with a unit in brackets is in that unit; the others have the units of the vectors. p
has the unit of pressure of the flow file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from granpinn.arrays import plain_array
from granpinn.data.flow import Surface, Walls
from granpinn.importers.columns import NAMES, read_headed, require, require_finite
from granpinn.importers.frame import Frame
from granpinn.importers.vectors import DataFileError

# Quantities of the columns; a slip has none.
DIMENSIONS = {"u": "velocity", "v": "velocity", "p": "pressure"}
WALL_COLUMNS = {name: NAMES.get(name, (name,)) for name in ("x", "y", *DIMENSIONS, "slip")}


def read_surface(path: Path, frame: Frame) -> Surface:
    """The points of a table with the columns t (or frame), x, y, in the axes of the vectors."""
    table = read_headed(path, ("x", "y"))
    time = "t" if "t" in table.columns else "frame"
    require(path, table.named, [] if time in table.columns else ["t (or frame)"])
    return _surface(path, {n: table.columns[n] for n in (time, "x", "y")}, table.units, frame)


def surface_of(arrays: Sequence[npt.ArrayLike], frame: Frame) -> Surface:
    """The points t, x, y [n] in the units and axes of the vectors."""
    try:
        columns = {
            name: plain_array(values, name, DataFileError).astype(np.float64)
            for name, values in zip("txy", arrays, strict=True)
        }
    except (TypeError, ValueError) as error:
        raise DataFileError(f"surface must be three arrays t, x, y of numbers: {error}") from None
    shapes = [values.shape for values in columns.values()]
    if len(shapes[0]) != 1 or len(set(shapes)) > 1 or shapes[0] == (0,):
        raise DataFileError(
            f"surface must be t, x, y of one length [n], got {', '.join(map(str, shapes))}"
        )
    return _surface("surface", columns, {}, frame)


def _surface(
    what: Path | str, columns: dict[str, Any], stated: Mapping[str, str], frame: Frame
) -> Surface:
    require_finite(what, columns)
    points = _in_si(what, columns, stated, frame)
    return Surface(points["t"], points["x"], points["y"])


def read_walls(path: Path, frame: Frame) -> Walls:
    """The walls of a table with the columns x, y of points in order, nan between two pieces.

    Further columns are u, v, slip and p.

    Raises:
        DataFileError: the file is no such table.
    """
    table = read_headed(path, ("x", "y"), WALL_COLUMNS)
    if len(table.columns) < len(table.named):
        names = ", ".join(column.name for column in table.named)
        raise DataFileError(
            f"{path} must have a first line with the columns x, y and any of u, v, slip and "
            f"p, got {names[:60]}: leave out the other columns"
        )
    require_finite(path, table.columns, nan=True)
    si = _in_si(path, table.columns, table.units, frame)
    if "v" in si:
        si["v"] = frame.up * si["v"]
    single = {n: si[n].astype(np.float32) for n in ("slip", "p") if n in si}
    return Walls(**si | single)


def _in_si(
    what: Path | str, columns: Mapping[str, Any], stated: Mapping[str, str], frame: Frame
) -> dict[str, Any]:
    """The columns in SI and in the axes of the flow; the time is t."""
    si: dict[str, Any] = {}
    for name, values in columns.items():
        unit, place = stated.get(name, ""), f"{what}: {name}"
        if name in ("t", "frame"):
            si["t"] = frame.moments(values, "frame" if name == "frame" else unit, place)
        elif name in ("x", "y"):  # in the units of the vectors
            factor = frame.factor(unit, "length", place)
            si[name] = values * factor / frame.length if unit else values
        elif name in DIMENSIONS:
            si[name] = values * frame.factor(unit, DIMENSIONS[name], place)
        else:
            si[name] = values
    si["x"], si["y"] = frame.place(si["x"], si["y"])
    return si
