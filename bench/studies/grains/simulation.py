"""Runs a scene in LAMMPS, and reads what it recorded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.lammps import Lammps
from bench.studies.grains.materials import TIME_STEP, Material
from bench.studies.grains.packing import write_data
from bench.studies.grains.scenes.scene import COLUMNS, DUMP, START, Scene, script
from granpinn.arrays import Float64


@dataclass(frozen=True)
class Snapshot:
    """Free grains at one time; of spheres, what each has per unit of width in a slab.

    Attributes:
        t: time since the start of the record.
        x, y, vx, vy, mass: [n].
        solid: area of each grain, [n].
        virial: contact stress of each grain times its area, xx, yy, xy, pressure positive, [n, 3].
    """

    t: float
    x: Float64
    y: Float64
    vx: Float64
    vy: Float64
    solid: Float64
    mass: Float64
    virial: Float64


def simulate(scene: Scene, material: Material, seed: int, lammps: Lammps, folder: Path) -> Path:
    """Runs the scene; the path of its dump file."""
    folder.mkdir(parents=True, exist_ok=True)
    write_data(folder / START, scene.packing(seed), scene.box, seed)
    lammps.run(script(scene, material), folder)
    return folder / DUMP


def snapshots(path: Path) -> Iterator[Snapshot]:
    """The snapshots of a dump file of disks, one after the other.

    Raises:
        ExperimentError: the file is no dump of these columns, or is cut off.
    """
    for t, table in tables(path, COLUMNS):
        # LAMMPS counts tension as positive.
        x, y, vx, vy, radius, mass = table[:, :6].T
        yield Snapshot(t, x, y, vx, vy, np.pi * radius**2, mass, virial=-table[:, 6:])


def tables(path: Path, columns: Sequence[str]) -> Iterator[tuple[float, Float64]]:
    """Time and values, [n, columns], of every snapshot of a dump file.

    Raises:
        ExperimentError: the file is no dump of these columns, or is cut off.
    """
    with path.open() as file:
        while file.readline():  # ITEM: TIMESTEP
            yield _table(file, path, columns)


def _table(file: TextIO, path: Path, columns: Sequence[str]) -> tuple[float, Float64]:
    try:
        step = int(file.readline())
        file.readline()
        count = int(file.readline())
    except ValueError:
        raise _broken(path, columns, "a header that is none") from None
    for _ in range(4):
        file.readline()
    found = tuple(file.readline().split()[2:])
    if found != tuple(columns):
        raise _broken(path, columns, f"the columns {' '.join(found)}")
    rows = [file.readline() for _ in range(count)]
    if not rows or not rows[-1].endswith("\n"):
        raise _broken(path, columns, "an end within a snapshot")
    table = np.fromstring(" ".join(rows), sep=" ").reshape(count, len(columns))
    return step * TIME_STEP, table


def _broken(path: Path, columns: Sequence[str], found: str) -> ExperimentError:
    return ExperimentError(
        f"{path} must be a dump with the columns {' '.join(columns)}, got {found}: make the scene "
        "again"
    )
