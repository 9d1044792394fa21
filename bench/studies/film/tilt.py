"""Tilt from the picture: python -m bench.studies.film.tilt SCENE... --out FOLDER

A scene is KIND_SEED_GRAIN_TURN, such as collapse_701_6_-12. Its film is rendered turned by TURN
degrees and measured with `--tilt auto`. Rows with the angle, or why there is none, go to
FOLDER/tilt.csv.

Defends: the angle is within its standard deviation; a slope is refused.
"""

from __future__ import annotations

import argparse
import csv
import re
from pathlib import Path

from bench.studies.film import render, scenes
from granpinn.filming import FilmSettings
from granpinn.filming.measurement import measure
from granpinn.importers import DataFileError

NUMBER = r"(-?\d+\.\d+)"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    own = parser.parse_args()
    own.out.mkdir(exist_ok=True)
    with (own.out / "tilt.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["scene", "true", "found", "sd", "refused"])
        for name in own.scenes:
            scene, folder = scenes.named(name), own.out / name
            if len([*folder.glob("*.png")]) < scene.shot.frames:
                render.write(scene.field, scene.shot, folder)
            settings = FilmSettings(**scene.settings() | {"tilt": "auto"})
            row: list[object] = ["", "", ""]
            try:
                text = measure(str(folder / "*.png"), settings).said[-1]
            except DataFileError as error:
                row[2] = error
            else:
                row[:2] = re.findall(NUMBER, text)
            writer.writerow([name, round(scene.tilt, 2), *row])
            file.flush()


if __name__ == "__main__":
    main()
