"""Spheres between side walls: what is seen of them in a slab beside a wall, and the wall's force.

A slab holds of every sphere the share of its volume within it. What a sphere carries (volume, mass,
momentum, contact stress) counts with this share, per unit of the thickness of the slab. So the
fields of a slab come from the same coarse-graining as those of disks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.studies.grains.coarse import XX, YY, Fields
from bench.studies.grains.scenes.channel import COLUMNS
from bench.studies.grains.scenes.scene import Scene
from bench.studies.grains.simulation import Snapshot, tables
from granpinn.arrays import Float64


def share(z: Float64, radius: Float64, low: float, high: float) -> Float64:
    """Share of the volume of spheres between two planes."""

    def below(plane: float) -> Float64:
        h = np.clip((plane - z) / radius, -1, 1)
        return np.asarray((2 + 3 * h - h**3) / 4)

    return below(high) - below(low)


def slabs(path: Path, low: float, high: float) -> Iterator[Snapshot]:
    """The snapshots of a dump file of spheres, as seen between two planes."""
    for t, table in tables(path, COLUMNS):
        x, y, z, vx, vy, radius, mass = table[:, :7].T
        part = share(z, radius, low, high) / (high - low)
        solid = 4 / 3 * np.pi * radius**3
        # LAMMPS counts tension as positive.
        virial = -table[:, 7:10] * part[:, None]
        yield Snapshot(t, x, y, vx, vy, solid * part, mass * part, virial)


def measured_bulk(fields: Fields) -> Fields:
    """The fields with the bulk fraction of their own: beside a flat wall grains lie looser. It is
    the median of the cells that are filled to a half."""
    return replace(fields, bulk=float(np.median(fields.phi[fields.phi > 0.5 * fields.bulk])))


def side_walls(scene: Scene, dump: Path, fields: Fields) -> dict[str, float]:
    """The effective friction of the side walls, over all rows of the grid with full cells.

    Returns:
        the shear stress of the walls against x over their normal stress (`friction`), and over the
        pressure (sigma_xx + sigma_yy)/2 of the grains (`friction_by_p`: it holds in a plane model
        with a force 2 friction p / gap).
    """
    n = len(fields.y)
    cell = float(fields.y[1] - fields.y[0])
    bottom = float(fields.y[0]) - cell / 2
    area = 2 * float(scene.attributes["period_x"]) * cell  # of a row of both walls
    forces = np.zeros((2, n))
    for count, (_, table) in enumerate(tables(dump, COLUMNS), start=1):  # noqa: B007
        row = np.clip(np.floor((table[:, 1] - bottom) / cell).astype(int), 0, n - 1)
        against, normal = -table[:, 11], np.abs(table[:, 13])
        forces += [np.bincount(row, force, n) for force in (against, normal)]
    full = fields.phi.mean(axis=(0, 2)) > 0.9 * fields.bulk
    shear, normal = forces[:, full].sum(axis=1) / (count * area)
    p = fields.stress[..., [XX, YY]].mean(axis=(0, 2, 3))[full].sum()
    return {"friction": float(shear / normal), "friction_by_p": float(shear / p)}
