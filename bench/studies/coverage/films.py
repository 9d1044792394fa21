"""Coverage of films: random collapses, filmed by an imaginary camera, measured by a PIV program.

python -m bench.studies.coverage.films --films 20 --draw 16 --out films \
    --openpiv-python openpiv/bin/python --json films.json

The chain is that of bench.studies.experiment, from the pictures to the flow file, one film on each
core. Material, I0, grains and aspect are drawn as in a varied study. Flow files of an earlier run
in `--out` are used again, and OpenPIV is needed for the missing ones only. Then all films are
identified as one batch; settings that are not its own go to the identification (`--device cuda`).

Defends: the 90 % intervals hold 85 to 95 % of the truths on vectors that a PIV program measured.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Sequence
from itertools import repeat
from pathlib import Path

from bench.studies import raw
from bench.studies.cores import on_all_cores
from bench.studies.coverage.materials import Task, draw
from bench.studies.coverage.run import identified
from bench.studies.experiment.commands import ExperimentError, Piv, convert, openpiv
from bench.studies.experiment.film import HEIGHT, column, shoot
from granpinn.simulation import Collapse

CELLS = 256  # of a simulation
PAIRS = 50  # of pictures
ACROSS = 1200  # px of the width of the box
DISPLACEMENT = 8.0  # px, of the fastest grains
WINDOW = 16  # px


def tasks_of(films: int, seed: int) -> list[Task]:
    """The collapses of the films; every one has the sampling of its film."""

    def filmed(task: Task) -> Task:
        collapse = dataclasses.replace(task.scene, stride=1, frames=PAIRS)
        return dataclasses.replace(task, scene=collapse)

    drawn = draw(films, 0, seed, varied=True, cells=CELLS, threads=1)
    return list(map(filmed, drawn))


def measured(task: Task, folder: Path, piv: Piv, pairs: int = PAIRS, across: int = ACROSS) -> Path:
    """The flow file of a film, made unless it is there; its pictures stay beside it."""
    own = folder / task.name
    path = own / "measured.h5"
    if path.exists():
        return path
    like = task.scene
    assert isinstance(like, Collapse)
    own.mkdir(parents=True, exist_ok=True)
    pixel = like.box[0] * HEIGHT / like.height / across
    film = shoot(column(like.cells, 4 * pairs, like), pairs, pixel, DISPLACEMENT, own, seed=0)
    piv(film, own / "vectors")
    convert(film, own / "vectors", own)
    return path


def by_openpiv(task: Task, folder: Path, python: str) -> Path:
    return measured(task, folder, lambda film, out: openpiv(python, WINDOW)(film, out))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--films", type=int, default=20, help="number of films")
    parser.add_argument("--draw", type=int, default=0, help="seed of the materials")
    parser.add_argument("--out", type=Path, required=True, help="folder that keeps the films")
    parser.add_argument("--openpiv-python", default=sys.executable, help="interpreter with OpenPIV")
    parser.add_argument("--measure-only", action="store_true", help="leave the identification out")
    parser.add_argument("--json", type=Path, help="file for the results")
    own, words, config = raw.parse(parser, arguments)
    if own.json is None and not own.measure_only:
        parser.error("--json must name a file for the results, or give --measure-only")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    tasks = tasks_of(own.films, own.draw)
    n = len(tasks)
    try:
        paths = on_all_cores(by_openpiv, tasks, repeat(own.out, n), repeat(own.openpiv_python, n))
    except ExperimentError as error:
        print(f"bench.studies.coverage.films: {error}", file=sys.stderr)
        return 1
    if not own.measure_only:
        rows = identified(tasks, paths, config)
        head = {"draw": own.draw, "settings": words, "steps": config.steps}
        raw.write(own.json, head | {"rows": rows})
    return 0


if __name__ == "__main__":
    sys.exit(main())
