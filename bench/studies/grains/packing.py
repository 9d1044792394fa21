"""Where grains start: loose lattices that settle under gravity, and glued grains as rough walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.studies.grains.materials import GRAIN_DENSITY, SPREAD
from granpinn.arrays import Float64, Int64

LATTICE = 1.18  # distance on a loose lattice, d: no two grains touch
SETTLED_AREA = 0.97  # area that a grain takes once it has settled, d^2
GLUED_DISTANCE = 0.95  # between the centres of neighbours of a rough wall, d
ROUGHNESS = 0.2  # of a rough wall: its grains lie off the line by at most this, d
FREE, FIXED, MOVING = 1, 2, 3  # types of grains


@dataclass(frozen=True)
class Packing:
    """Grains at the start: type [n] and centre [n, 2]."""

    kind: Int64
    centre: Float64


def lattice(left: float, right: float, bottom: float, area: float) -> Packing:
    """Free grains between two vertical lines, as many as fill an area once they have settled."""
    columns = int((right - left - 0.2) / LATTICE)
    count = round(area / SETTLED_AREA)
    row, column = np.divmod(np.arange(count), columns)
    gap = (right - left) / columns
    x = left + gap * (column + 0.5 + 0.05 * (-1.0) ** row)
    return _packing(FREE, x, bottom + LATTICE * (row + 0.7))


def disk(radius: float, area: float) -> Packing:
    """Free grains on a lattice in a circle around the origin, from below up to an area."""
    n = int(radius / LATTICE) + 1
    y, x = np.meshgrid(*(LATTICE * np.arange(-n, n + 1),) * 2, indexing="ij")
    inside = np.hypot(x, y) < radius - 1.5
    count = min(round(area / SETTLED_AREA), int(inside.sum()))
    return _packing(FREE, x[inside][:count], y[inside][:count])


def rough_line(
    start: Sequence[float], end: Sequence[float], seed: int, kind: int = FIXED
) -> Packing:
    """Glued grains along a line."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.hypot(*(b - a)))
    n = max(2, round(length / GLUED_DISTANCE))
    along = (np.arange(n) + 0.5) / n
    across = np.random.default_rng(seed).uniform(-ROUGHNESS, ROUGHNESS, n)
    normal = np.array([-(b - a)[1], (b - a)[0]]) / length
    centre = a + along[:, None] * (b - a) + across[:, None] * normal
    return Packing(np.full(n, kind), centre)


def rough_circle(radius: float, seed: int, kind: int = MOVING) -> Packing:
    """Glued grains around the origin."""
    n = round(2 * np.pi * radius / GLUED_DISTANCE)
    r = radius + np.random.default_rng(seed).uniform(-ROUGHNESS, ROUGHNESS, n)
    angle = 2 * np.pi * np.arange(n) / n
    return _packing(kind, r * np.cos(angle), r * np.sin(angle))


def _packing(kind: int, x: Float64, y: Float64) -> Packing:
    return Packing(np.full(len(x), kind), np.stack([x, y], axis=1))


def write_data(path: Path, parts: Sequence[Packing], box: Sequence[float], seed: int) -> int:
    """The data file of LAMMPS, with diameters and small random velocities drawn from the seed.

    Args:
        box: smallest x, largest x, smallest y, largest y.

    Returns:
        the number of grains.
    """
    kind = np.concatenate([part.kind for part in parts])
    centre = np.concatenate([part.centre for part in parts])
    n = len(kind)
    rng = np.random.default_rng(seed)
    diameter = rng.uniform(1 - SPREAD, 1 + SPREAD, n)
    velocity = np.where(kind[:, None] == FREE, rng.uniform(-0.5, 0.5, (n, 2)), 0.0)
    head = (
        f"grains\n\n{n} atoms\n3 atom types\n\n{box[0]:g} {box[1]:g} xlo xhi\n"
        f"{box[2]:g} {box[3]:g} ylo yhi\n-0.5 0.5 zlo zhi\n"
    )
    atoms = "\n".join(
        f"{i + 1} {kind[i]} {diameter[i]:.6f} {GRAIN_DENSITY:.10f} "
        f"{centre[i, 0]:.6f} {centre[i, 1]:.6f} 0"
        for i in range(n)
    )
    speeds = "\n".join(
        f"{i + 1} {velocity[i, 0]:.6f} {velocity[i, 1]:.6f} 0 0 0 0" for i in range(n)
    )
    path.write_text(f"{head}\nAtoms # sphere\n\n{atoms}\n\nVelocities\n\n{speeds}\n")
    return n
