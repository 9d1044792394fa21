"""Where grains start: loose lattices that settle under gravity, and glued grains as rough walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.studies.grains.materials import SPREAD
from granpinn.arrays import Float64, Int64

LATTICE = 1.18  # distance on a loose lattice, d: no two grains touch
SETTLED_AREA = 0.97  # area that a disk takes once it has settled, d^2
SETTLED_VOLUME = 0.92  # volume that a sphere takes once it has settled, d^3
GLUED_DISTANCE = 0.95  # between the centres of neighbours of a rough wall, d
ROUGHNESS = 0.2  # of a rough wall: its grains lie off the line by at most this, d
FREE, FIXED, MOVING = 1, 2, 3  # types of grains


@dataclass(frozen=True)
class Packing:
    """Grains at the start: type [n] and centre [n, 2] or [n, 3]."""

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


def block(length: float, width: float, height: float) -> Packing:
    """Free spheres above the floor of a channel, as many as fill a height once they settled."""
    n = [int((extent - 0.2) / LATTICE) for extent in (length, width)]
    count = round(length * width * height / SETTLED_VOLUME)
    layer, rest = np.divmod(np.arange(count), n[0] * n[1])
    row, column = np.divmod(rest, n[0])
    x = length / n[0] * (column + 0.5 + 0.05 * (-1.0) ** layer)
    z = width / n[1] * (row + 0.5)
    return Packing(np.full(count, FREE), np.stack([x, LATTICE * (layer + 0.7), z], axis=1))


def rough_floor(length: float, width: float, height: float, seed: int) -> Packing:
    """Glued spheres at a height, on the floor of a channel."""
    n = [round(extent / GLUED_DISTANCE) for extent in (length, width)]
    x, z = np.meshgrid(
        *((np.arange(k) + 0.5) * extent / k for k, extent in zip(n, (length, width), strict=True))
    )
    y = height + np.random.default_rng(seed).uniform(-ROUGHNESS, ROUGHNESS, x.size)
    return Packing(np.full(x.size, FIXED), np.stack([x.ravel(), y, z.ravel()], axis=1))


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
        box: smallest x, largest x, smallest y, largest y; of spheres, smallest and largest z too.

    Returns:
        the number of grains.
    """
    kind = np.concatenate([part.kind for part in parts])
    centre = np.concatenate([part.centre for part in parts])
    n = len(kind)
    rng = np.random.default_rng(seed)
    diameter = rng.uniform(1 - SPREAD, 1 + SPREAD, n)
    velocity = np.where(kind[:, None] == FREE, rng.uniform(-0.5, 0.5, centre.shape), 0.0)
    if centre.shape[1] == 2:
        centre, velocity = (np.pad(array, ((0, 0), (0, 1))) for array in (centre, velocity))
    low, high = box[4:] or (-0.5, 0.5)
    head = (
        f"grains\n\n{n} atoms\n3 atom types\n\n{box[0]:g} {box[1]:g} xlo xhi\n"
        f"{box[2]:g} {box[3]:g} ylo yhi\n{low:g} {high:g} zlo zhi\n"
    )
    atoms = "\n".join(
        f"{i + 1} {kind[i]} {diameter[i]:.6f} 1 {' '.join(f'{x:.6f}' for x in centre[i])}"
        for i in range(n)
    )
    speeds = "\n".join(
        f"{i + 1} {' '.join(f'{v:.6f}' for v in velocity[i])} 0 0 0" for i in range(n)
    )
    path.write_text(f"{head}\nAtoms # sphere\n\n{atoms}\n\nVelocities\n\n{speeds}\n")
    return n
