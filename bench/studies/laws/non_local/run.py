"""What grains that creep below yield look like to local laws.

    python -m bench.studies.laws.non_local.run SCENES --json non_local.json

SCENES is a folder of scenes that `bench.studies.grains.make` has made, with stress in
reference.npz. Scenes that are not steady are left out, but for silos and chutes, whose late times
are. No network is trained: the laws are fitted to the stress of the grains.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.run import scenes_in
from bench.studies.laws.non_local.laws import at_one_number, cells_of, curve, judged, reached
from bench.studies.laws.non_local.profiles import creep, profile
from bench.studies.laws.non_local.zones import zones_of

WAYS = {"along_D": ("mu", "se"), "norm": ("norm", "norm_se")}
# Disks only: spheres between side walls have another law.
KINDS = ("drum", "heap", "plane_shear", "silo", "chute_slow", "chute_fast", "chute_fast_steady")


def measured(folder: Path) -> dict[str, Any]:
    """A scene: its profile, its friction by I, what its data reach, and the laws fitted to it."""
    zones = zones_of(folder)
    cells = cells_of(zones, folder)
    rows = profile(zones)
    return {
        "shear_cell": zones.truth,
        "profile": rows,
        "creep": creep(rows, zones.truth["mu_s"]),
        "curve": curve(cells),
        "reached": reached(cells, zones.truth),
        "laws": judged(cells, cells.weight),
        "laws_alike": judged(cells, cells.weight * 0 + 1),
    }


def line(name: str, found: dict[str, Any]) -> str:
    """A scene in one line."""
    held, fall = found["reached"], found["creep"]
    text = f"{name:<22} slow cells {held['slow_percent']:5.1f} %"
    if fall is None:
        return text
    return f"{text}  length {fall['length']:.2f} +- {fall['length_se']:.2f} d  A {fall['A']:.2f}"


def same_number(scenes: dict[str, Any], names: tuple[str, str]) -> dict[str, Any]:
    """For each material, the friction of its scenes at the same I."""
    made = {}
    for material in sorted({name.rpartition("-")[2] for name in scenes}):
        mine = {k: s for k, s in scenes.items() if k.endswith(f"-{material}")}
        truth = next(iter(mine.values()))["shear_cell"]
        made[material] = at_one_number({k: s["curve"] for k, s in mine.items()}, names, truth)
    return made


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--json", type=Path, required=True)
    chosen = parser.parse_args()
    scenes = {}
    try:
        for folder in scenes_in(chosen.scenes):
            if folder.name.rpartition("-")[0] in KINDS:
                scenes[folder.name] = measured(folder)
                print(line(folder.name, scenes[folder.name]), flush=True)
    except ExperimentError as error:
        print(f"bench.studies.laws.non_local.run: {error}", file=sys.stderr)
        return 1
    one = {way: same_number(scenes, names) for way, names in WAYS.items()}
    command = " ".join(["python -m bench.studies.laws.non_local.run", *sys.argv[1:]])
    raw.write(chosen.json, {"command": command, "scenes": scenes, "at_one_I": one})
    return 0


if __name__ == "__main__":
    sys.exit(main())
