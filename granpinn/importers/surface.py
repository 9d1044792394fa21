r"""Points of the free surface: where the volume fraction crosses 1/2, or from a table.

Between the centers of two neighboring cells, one in the grains and one outside, the surface lies
where c = 1/2 by linear interpolation; for a mask, half way. Some edges of a mask are no free
surface: the bed and the side walls are edges too. An edge counts if it faces up (against
gravity), or if it faces sideways and has grains beyond it at another time. An edge that faces down
never counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from granpinn.arrays import Float64
from granpinn.data.flow import Surface
from granpinn.importers import units
from granpinn.importers.frame import Frame
from granpinn.importers.textfile import TextFile
from granpinn.importers.tracks import column_names
from granpinn.importers.vectors import LARGEST, DataFileError, VectorFields, largest

HALF = 0.5
_UPWARDS = 0.5  # cosine of the angle to the vertical
NEAR = 0.1  # of 1/2: scattered cells that the surface cuts through


def from_fraction(
    c: Float64, t: Float64, y: Float64, x: Float64, gravity: tuple[float, float]
) -> Surface | None:
    """The free surface of a volume fraction [T, Y, X]; None if there is none."""
    g = math.hypot(*gravity)
    up = {1: -gravity[1] / g, 2: -gravity[0] / g}  # cosine of each axis with the vertical
    ever = (c > HALF).any(axis=0)
    points = []
    for axis, coordinate in ((1, y), (2, x)):
        low = np.moveaxis(c, axis, 0)[:-1]
        high = np.moveaxis(c, axis, 0)[1:]
        for grains_below in (True, False):
            inner, outer = (low, high) if grains_below else (high, low)
            cosine = up[axis] if grains_below else -up[axis]
            crossing = (inner > HALF) & (outer <= HALF)
            if cosine < -_UPWARDS:
                continue
            if cosine < _UPWARDS:
                seen = np.moveaxis(np.broadcast_to(ever, c.shape), axis, 0)
                crossing &= seen[1:] if grains_below else seen[:-1]
            place = np.nonzero(crossing)
            share = (HALF - low[place]) / (high[place] - low[place])
            along = coordinate[place[0]] + share * np.diff(coordinate)[place[0]]
            # After moveaxis the other axes keep their order: (frame, column) or (frame, row).
            other = (x if axis == 1 else y)[place[2]]
            pair = (other, along) if axis == 1 else (along, other)
            points.append(np.stack([t[place[1]], *pair]))
    found = np.concatenate(points, axis=1)
    if found.shape[1] == 0:
        return None
    found = found[:, np.lexsort((found[2], found[1], found[0]))]
    return Surface(t=found[0], x=found[1], y=found[2])


def from_scattered(fields: VectorFields) -> Surface | None:
    """Points of scattered cells that are about half full."""
    if fields.c is None:
        return None
    near = np.abs(fields.c - HALF) < NEAR
    if not near.any():
        return None
    return Surface(t=fields.t[near], x=fields.x[near], y=fields.y[near])


def from_table(path: Path, frame: Frame, rate: float | None) -> Surface:
    """The points of a CSV file with the columns t (or frame), x, y.

    A column with a unit in brackets is in that unit; the others have the units of the vectors.

    Args:
        frame: of the vectors, in whose axes the points are given.
        rate: seconds per frame, or None.
    """
    text = TextFile(path)
    head = text.head(1)[0]
    known, found_units = column_names(head)
    time = "t" if "t" in known else "frame"
    missing = [name for name in ("x", "y", time) if name not in known]
    if missing:
        raise DataFileError(
            f"{path} must have a first line with the columns t (or frame), x, y, got {head[:60]!r}"
        )
    table = text.numbers(1)
    if table.shape[1] <= max(known.values()):
        raise DataFileError(f"{path} must have the columns of its first line, got fewer")
    columns = {name: table[:, known[name]] for name in (time, "x", "y")}
    for name, own, dimension in (("x", frame.length, "length"), ("y", frame.length, "length")):
        if name in found_units:
            px = frame.length if units.has(found_units[name], "px") else None
            factor = units.factor(found_units[name], dimension, f"{path}: {name}", px)
            columns[name] = columns[name] * (factor / own)
    t = columns[time]
    if time in found_units:
        factor = units.factor(found_units[time], "time", f"{path}: {time}", frame=rate)
        # A time in its own unit counts from the release, like those of the flow.
        seconds = t * factor
    else:
        seconds = frame.times(t)
    return _finite(str(path), Surface(seconds, *frame.place(columns["x"], columns["y"])), time)


def from_arrays(points: Sequence[npt.ArrayLike], frame: Frame) -> Surface:
    """The points t, x, y [n] in the units and axes of the vectors."""
    try:
        t, x, y = (np.asarray(values, np.float64) for values in points)
    except (TypeError, ValueError) as error:
        raise DataFileError(f"surface must be three arrays t, x, y of numbers: {error}") from None
    if t.ndim != 1 or not t.shape == x.shape == y.shape or t.size == 0:
        shapes = ", ".join(str(list(values.shape)) for values in (t, x, y))
        raise DataFileError(f"surface must be t, x, y of one length [n], got {shapes}")
    return _finite("surface", Surface(frame.times(t), *frame.place(x, y)), "t")


def _finite(where: str, surface: Surface, time: str) -> Surface:
    for name, values in ((time, surface.t), ("x", surface.x), ("y", surface.y)):
        if not np.isfinite(values).all() or largest(values) > LARGEST:
            raise DataFileError(
                f"{where} must have a finite {name} of at most {LARGEST:g} in every row, got "
                f"{values[~(np.abs(values) <= LARGEST)][0]:g}: leave this point out"
            )
    return surface
