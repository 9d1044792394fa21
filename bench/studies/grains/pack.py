"""All scenes of the validation pack by one command, some at a time.

    python -m bench.studies.grains.pack --lmp lammps/bin/lmp --out scenes --jobs 2

OUT gets a folder SCENE-FRICTION for every scene. A folder that has a scene.json is left as it is,
so an interrupted command can be given again. Both views of the channel come from one run,
and so do the drum as its mean and as a film.

Defends: every scene is made in at most 15 CPU minutes.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from bench.studies.grains.make import SUMMARY
from bench.studies.grains.materials import FRICTIONS
from bench.studies.grains.scenes.scene import DUMP

OF_ALL = ("collapse_2", "collapse_6", "chute_fast", "chute_fast_steady", "heap", "drum", "silo")
PACK = [(name, friction) for name in (*OF_ALL, "plane_shear") for friction in FRICTIONS]
PACK += [("chute_slow", 0.4), ("channel_wall", 0.4)]
# Scenes that take the grains of another: its dump is kept until they are made.
SAME_GRAINS = {"channel_wall": "channel_mean", "drum": "drum_filmed"}


def commands(scene: str, friction: float, out: Path, lmp: str | None) -> list[list[str]]:
    """The commands that make a scene, and the one with the same grains."""
    module = [sys.executable, "-m", "bench.studies.grains.make"]

    def make(name: str, *more: str) -> list[str]:
        folder = out / f"{name}-{friction:g}"
        return [*module, name, "--material", f"{friction:g}", "--out", str(folder), *more]

    program = [] if lmp is None else ["--lmp", lmp]
    other = SAME_GRAINS.get(scene)
    if other is None:
        return [make(scene, *program)]
    dump = out / f"{scene}-{friction:g}" / "lammps" / DUMP
    return [make(scene, "--keep", *program), make(other, "--dump", str(dump))]


def run(lines: Sequence[Sequence[str]]) -> int:
    """Runs commands one after the other until one fails; its exit code."""
    for line in lines:
        code = subprocess.run(line, check=False).returncode
        if code:
            return code
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, required=True, help="folder of the scenes")
    parser.add_argument("--lmp", help="the program LAMMPS")
    parser.add_argument("--jobs", type=int, default=1, help="scenes at a time, a core each")
    chosen = parser.parse_args()
    missing = [
        (scene, friction)
        for scene, friction in PACK
        if not (chosen.out / f"{scene}-{friction:g}" / SUMMARY).exists()
    ]
    with ThreadPoolExecutor(max(1, chosen.jobs)) as pool:
        codes = pool.map(run, (commands(*member, chosen.out, chosen.lmp) for member in missing))
    return max(codes, default=0)


if __name__ == "__main__":
    sys.exit(main())
