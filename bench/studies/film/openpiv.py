"""The same films by OpenPIV and `granpinn.convert`.

    python -m bench.studies.film.openpiv SCENE --films FOLDER --openpiv-python PYTHON

FOLDER/SCENE has the frames of bench.studies.film.run. The frames before and after each of about 60
times are a pair: windows of 32, 16 and 16 px, a mask and a line where the brightness falls to half.
Writes FOLDER/SCENE-openpiv/measured.h5.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np
from PIL import Image

from bench.studies.experiment.commands import convert, openpiv
from bench.studies.experiment.film import FRACTION, Film, write_pair
from bench.studies.experiment.particle_images import Camera, grain_level
from bench.studies.film import scenes

PAIRS, WINDOW = 60, 16  # px


def pairs(scene: scenes.Scene, frames: Path, out: Path) -> Film:
    """The pairs of a film with their masks and surface lines."""
    shot = scene.shot
    camera = Camera(shot.pixel, shot.rows - shot.rows % 8, shot.columns - shot.columns % 8)
    pictures = sorted(frames.glob("*.png"))
    moving = len(pictures) + shot.first
    middles = np.arange(1 - shot.first, len(pictures) - 1, moving // PAIRS)
    folder = out / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["frame,x,y"]
    for k, middle in enumerate(middles):
        images = [np.asarray(Image.open(pictures[middle + s])) for s in (-1, 1)]
        first, second = (image[-camera.rows :, : camera.columns] for image in images)
        level = grain_level((first, second), sigma=shot.grain)
        lines += write_pair(folder, k, (first, second), level)
    (out / "surface.csv").write_text("\n".join(lines) + "\n")
    times = ((middles + shot.first) / shot.rate).tolist()
    grain = scene.flow.grain_diameter * math.sqrt(FRACTION)
    return Film(grain, scene.field, camera, times, 2 / shot.rate, folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scene")
    parser.add_argument("--films", type=Path, required=True)
    parser.add_argument("--openpiv-python", required=True)
    own = parser.parse_args()
    scene = scenes.named(own.scene)
    out = own.films / f"{own.scene}-openpiv"
    film = pairs(scene, own.films / own.scene, out)
    begin = time.monotonic()
    openpiv(own.openpiv_python, WINDOW)(film, out / "vectors")
    print(f"OpenPIV: {len(film.times)} pairs in {time.monotonic() - begin:.0f} s")
    convert(film, out / "vectors", out)


if __name__ == "__main__":
    main()
