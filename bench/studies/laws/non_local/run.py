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

# Disks only: spheres between side walls have another law.
KINDS = ("drum", "heap", "plane_shear", "silo", "chute_slow", "chute_fast", "chute_fast_steady")


def measured(folder: Path) -> dict[str, Any]:
    """A scene: its profile, its friction by I, what its data reach, and the laws fitted to it."""
    zones = zones_of(folder)
    cells = cells_of(zones, folder)
    rows = profile(zones)
    return {
        "mu_s": zones.truth["mu_s"],
        "profile": rows,
        "creep": creep(rows, zones.truth["mu_s"]),
        "curve": curve(cells),
        "reached": reached(cells, zones.truth),
        "laws": judged(cells, cells.weight),
        "laws_alike": judged(cells, cells.weight * 0 + 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--json", type=Path, required=True)
    chosen = parser.parse_args()
    try:
        folders = [f for f in scenes_in(chosen.scenes) if f.name.rpartition("-")[0] in KINDS]
    except ExperimentError as error:
        print(f"bench.studies.laws.non_local.run: {error}", file=sys.stderr)
        return 1
    scenes = {}
    for folder in folders:
        scenes[folder.name] = measured(folder)
        print(folder.name, scenes[folder.name]["creep"], flush=True)
    materials = sorted({name.rpartition("-")[2] for name in scenes})
    one = {
        material: at_one_number(
            {k: s["curve"] for k, s in scenes.items() if k.endswith(f"-{material}")}
        )
        for material in materials
    }
    command = " ".join(["python -m bench.studies.laws.non_local.run", *sys.argv[1:]])
    raw.write(chosen.json, {"command": command, "scenes": scenes, "at_one_I": one})
    return 0


if __name__ == "__main__":
    sys.exit(main())
