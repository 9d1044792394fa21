"""Runs the commands of docs/gallery.md and records their output and pictures.

python -m docs.generate.gallery FOLDER [NAME ...]

FOLDER takes the flows and runs. The scenes of grains are made by `python -m bench.studies.grains`,
and are expected below FOLDER/scenes.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from docs.generate.demonstration import side_by_side

DOCS = Path(__file__).parents[1]
RECORD = DOCS / "results" / "gallery.json"
PICTURES = DOCS / "images" / "gallery"
HEIGHT = 480  # pixels
COLOURS = 128


class Case(NamedTuple):
    """A part of the page.

    Attributes:
        words: what is seen.
        commands: as a user types them.
        figures: PNG files that they make, side by side.
    """

    title: str
    words: str
    commands: tuple[str, ...]
    figures: tuple[str, ...]


def of_run(folder: str, *names: str) -> tuple[str, ...]:
    """Figures of a run folder."""
    return tuple(f"{folder}/figures/{name}.png" for name in names)


ANSWER = ("mu_s ", "mu_2 ", "b ", "mu(I) ", "GOOD", "CARE", "DO NOT USE")
CASES = {
    "collapse": Case(
        "A column collapses",
        "The collapse that comes with granpinn: velocity, law and pressure.",
        ("granpinn train --out collapse",),
        of_run("collapse", "velocity", "friction_law"),
    ),
    "chute": Case(
        "A layer flows down a chute",
        "A simulated layer of 20 grain diameters starts to flow on a slope of 27 degrees.",
        (
            "granpinn simulate chute --slope 27 --height 20 --d 1 --out chute.h5",
            "granpinn train chute.h5 --out chute",
        ),
        of_run("chute", "velocity", "friction_law"),
    ),
    "drum": Case(
        "Grains in a rotating drum",
        "A scene of simulated grains (discrete elements) with friction 0.4, seen as in a film.",
        ("granpinn train scenes/drum_filmed-0.4/flow.h5 --out drum",),
        of_run("drum", "velocity", "friction_law"),
    ),
    "particles": Case(
        "Tracked grains",
        "Positions and velocities of grains in millimetres, with noise and lost grains. `convert` "
        "traces the free surface from their density.",
        ("python -m bench.studies.experiment.tracks particles",),
        of_run("particles/run", "velocity", "friction_law"),
    ),
    "ensemble": Case(
        "Eight networks",
        "Networks with different seeds, on vectors with noise of 10 %. Their scatter is part of "
        "the error bars.",
        ("granpinn train --noise 0.1 --members 8 --out ensemble",),
        of_run("ensemble", "friction_law"),
    ),
    "own-law": Case(
        "A law of your own",
        "mu = mu_s + b I, written in torch ([guide](guides/own-law.md)).",
        ("python examples/own_law.py --out own-law",),
        of_run("own-law", "friction_law"),
    ),
    "burgers": Case(
        "Another equation",
        "The Burgers equation on the kernels of granpinn ([guide](guides/other-equations.md)).",
        ("python examples/residual_in_torch.py --figure burgers.png",),
        ("burgers.png",),
    ),
}


def page() -> str:
    """The parts of docs/gallery.md."""
    printed = json.loads(RECORD.read_text(encoding="utf-8"))
    parts = []
    for name, case in CASES.items():
        commands, lines = "\n".join(case.commands), answer(printed[name])
        parts += [
            f"## {case.title}",
            f"![{case.title}](images/gallery/{name}.png)",
            case.words,
            f"```bash\n{commands}\n```",
            f"```text\n{lines}\n```",
        ]
    return "\n\n".join(parts)


def answer(printed: str) -> str:
    """The lines of the values and the grade; all lines where there are none."""
    lines = printed.strip().splitlines()
    return "\n".join([line for line in lines if line.startswith(ANSWER)] or lines)


def make(name: str, folder: Path) -> str:
    """Run the commands of a part in a folder, and keep its picture; what the last one printed."""
    case, root = CASES[name], DOCS.parent
    examples = folder / "examples"
    if not examples.exists():
        examples.symlink_to(root / "examples")
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(root), *filter(None, sys.path)]),
    }
    for command in case.commands:
        program, *words = shlex.split(command)
        called = [sys.executable, *(["-m", program] if program == "granpinn" else []), *words]
        done = subprocess.run(
            called, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True, check=True
        )
    picture = side_by_side([folder / figure for figure in case.figures], HEIGHT)
    PICTURES.mkdir(exist_ok=True)
    picture.quantize(COLOURS).save(PICTURES / f"{name}.png", optimize=True)
    return done.stdout


def main() -> int:
    """Makes all parts, or those that are named."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(CASES))
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in options.names or CASES:
        printed = make(name, options.folder)
        known = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
        RECORD.write_text(json.dumps(known | {name: printed}, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
