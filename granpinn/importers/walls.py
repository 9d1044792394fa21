"""Walls from a table: points in order, a row of nan between two pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from granpinn.data.flow import Walls
from granpinn.importers.columns import NAMES, read_headed, require_finite
from granpinn.importers.frame import Frame
from granpinn.importers.vectors import DataFileError

# Quantities of the columns; a slip has none.
DIMENSIONS = {
    **dict.fromkeys(("x", "y"), "length"),
    "t": "time",
    **dict.fromkeys(("u", "v"), "velocity"),
    **dict.fromkeys(("p", "tau"), "pressure"),
}
ROLES = {name: NAMES.get(name, (name,)) for name in (*DIMENSIONS, "slip")}


def from_table(path: Path, frame: Frame) -> Walls:
    """The walls of a CSV file with the columns x, y, and t, u, v, slip, p, tau where known.

    A column with a unit in brackets is in that unit; the others have the units of the vectors, p
    and tau the unit of pressure of the flow file.

    Args:
        frame: of the vectors, in whose axes the points are given.

    Raises:
        DataFileError: the file is no such table.
    """
    table = read_headed(path, ("x", "y"), ROLES)
    if len(table.columns) < len(table.named):
        names = ", ".join(column.name for column in table.named)
        raise DataFileError(
            f"{path} must have a first line with the columns x, y and any of t, u, v, slip, p, "
            f"tau, got {names[:60]}: leave out the other columns"
        )
    require_finite(path, table.columns, nan=True)
    si = {
        name: values * frame.factor(table.units.get(name), DIMENSIONS[name], f"{path}: {name}")
        for name, values in table.columns.items()
        if name in DIMENSIONS and name != "t"
    }
    if "t" in table.columns:
        si["t"] = frame.moments(table.columns["t"], table.units.get("t"), f"{path}: t")
    if "v" in si:
        si["v"] = frame.up * si["v"]
    x, y = frame.place(si["x"] / frame.length, si["y"] / frame.length)
    single = {name: table.columns[name] for name in ("slip",) if name in table.columns}
    single |= {name: si[name] for name in ("p", "tau") if name in si}
    return Walls(
        x=x,
        y=y,
        t=si.get("t"),
        u=si.get("u"),
        v=si.get("v"),
        **{name: values.astype(np.float32) for name, values in single.items()},
    )
