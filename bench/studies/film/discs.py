"""Films of discrete elements: python -m bench.studies.film.discs MATERIAL --lmp LMP --out FOLDER

A collapse of disks (bench.studies.grains, `collapse_2`) is drawn as a film, a frame for each
snapshot, and measured with `granpinn.film`: OUT/flow.h5. `--run` scores a run of granpinn.train on
it, against the law that the stress of the same scene, made by bench.studies.grains.make, obeys.

Defends: the law of a film of discrete elements is within 3 % of the scene's own.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path

import numpy as np
from PIL import Image

from bench.studies.film.render import SPOTS, Grains, Shot, exposed
from bench.studies.film.scenes import MARGIN
from bench.studies.grains.lammps import Lammps
from bench.studies.grains.materials import Material
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.scenes.scene import COLUMNS
from bench.studies.grains.score import line, score
from bench.studies.grains.simulation import simulate, tables
from granpinn import film
from granpinn.data import write_flow

SCENE, SEED, GRAIN = "collapse_2", 5, 7.0  # px
MM, GRAVITY = 1e-3, 9.81  # a grain is 1 mm wide
MOST = 20000  # grains
TRACKED = ("id", *COLUMNS, "omegaz")


def render(dump: Path, dropped: float, size: tuple[float, float], folder: Path) -> list[float]:
    """The frames of a dump after the time `dropped`; the times of all.

    Args:
        size: width and height of the picture, grain diameters.
    """
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng([SEED, 54])
    columns, rows = (math.ceil(n * GRAIN) + MARGIN for n in size)
    shot = Shot(1 / GRAIN, GRAIN, 1.0, 0, 0, rows, columns, SEED)
    low, high = np.array([0.2, 0, -0.6]), np.array([0.8, 2 * np.pi, 0.6])
    times: list[float] = []
    last, angle = 0.0, np.zeros(MOST)
    bright, spots = random.uniform(70, 170, MOST), random.uniform(low, high, (MOST, SPOTS, 3))
    for t, table in tables(dump, TRACKED):
        values = dict(zip(TRACKED, table[np.argsort(table[:, 0])].T, strict=True))
        who = values["id"].astype(int)  # a grain that leaves the box is lost
        angle[who] += values["omegaz"] * (t - last)
        last = t
        if t < dropped:
            continue
        place = np.stack([values["x"], values["y"]])
        grains = Grains(place, angle[who], values["radius"] * GRAIN, bright[who], spots[who])
        picture = exposed([place], grains, shot, random)
        Image.fromarray(picture).save(folder / f"frame_{len(times):05d}.png", compress_level=1)
        times.append(t)
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("material", type=float)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--lmp", help="the program LAMMPS")
    parser.add_argument("--dump", type=Path, help="draw this dump, without LAMMPS")
    parser.add_argument("--run", type=Path, help="score this run")
    parser.add_argument("--scenes", type=Path, help="folder of bench.studies.grains.make")
    own = parser.parse_args()
    if own.run:
        print(line(score(own.run, own.scenes / f"{SCENE}-{own.material:g}")))
        return
    material = Material(own.material)
    scene = dataclasses.replace(SCENES[SCENE](material), columns=TRACKED)
    dump = own.dump or simulate(scene, material, SEED, Lammps(own.lmp), own.out / "lammps")
    grid = scene.grid
    times = render(dump, scene.dropped, (grid.right, grid.top), own.out / "frames")
    second = math.sqrt(MM / GRAVITY)  # of the units of the scene
    rate = (len(times) - 1) / (times[-1] - times[0]) / second
    density = f"{scene.shape.bulk_density * 1000!r} kg/m^3"
    flow = film(
        str(own.out / "frames" / "*.png"),
        page=own.out / "film.html",
        report=print,
        scale=f"{1 / GRAIN!r} mm/px",
        frame_rate=f"{rate!r} Hz",
        grain_diameter="1 mm",
        density=density,
        grain_density=density,  # as in the flow file of the scene
        start=f"{times[0] * second!r} s",
        origin=f"-0.5,{math.ceil(grid.top * GRAIN) + MARGIN - 0.5}",
    )
    write_flow(flow, own.out / "flow.h5")


if __name__ == "__main__":
    main()
