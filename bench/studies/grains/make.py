"""Makes the scenes of grains: LAMMPS, coarse-graining, flow file, its own law, baseline.

    python -m bench.studies.grains.make --lmp lammps/bin/lmp --out scenes --only drum-0.4

OUT gets a folder SCENE-FRICTION for every scene, on each core one. A folder that has a scene.json
is left as it is, so an interrupted command can be given again. flow.h5 is the flow file, scene.json
what the scene says of itself: its own law, the ratio of its dissipation to that of the shear cell's
law, its noise, and the law that the plain momentum balance finds.

Defends: a scene is made in at most 15 minutes on one core.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.cores import on_all_cores
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.coarse import Fields, coarse_grain
from bench.studies.grains.flow_file import cropped, flow_of
from bench.studies.grains.lammps import Lammps
from bench.studies.grains.law import SLOWEST, mu_of_i
from bench.studies.grains.materials import FRICTIONS, I0, Material, truth_of
from bench.studies.grains.own_law import own_law, reference
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.scenes.scene import Scene
from bench.studies.grains.simulation import simulate, snapshots
from bench.studies.grains.slabs import measured_bulk, side_walls, slabs
from bench.studies.grains.surface import fraction, surface_height
from granpinn.arrays import Float64
from granpinn.data import Flow, write_flow
from granpinn.inspection.momentum_balance import baseline

FLOW, SUMMARY = "flow.h5", "scene.json"
SEED = 0
OF_ALL = ("collapse_2", "collapse_6", "chute_fast", "chute_fast_steady", "heap", "drum", "silo")
PACK = [(name, friction) for name in (*OF_ALL, "plane_shear") for friction in FRICTIONS]
PACK += [("chute_slow", 0.4), ("channel_wall", 0.4)]
SAME_GRAINS = {"channel_wall": "channel_mean", "drum": "drum_filmed"}  # two views of one run


def made(name: str, friction: float, out: Path, lmp: str | None) -> None:
    """The files of a scene, and of the other view of its grains."""
    material = Material(friction)
    with tempfile.TemporaryDirectory() as work:
        scene = SCENES[name](material)
        dump = simulate(scene, material, SEED, Lammps(lmp), Path(work))
        for view in filter(None, (name, SAME_GRAINS.get(name))):
            folder = out / f"{view}-{material.name}"
            folder.mkdir(parents=True, exist_ok=True)
            summary = make(view, material, dump, folder)
            raw.write(folder / SUMMARY, summary)
            print(line(summary), flush=True)


def make(name: str, material: Material, dump: Path, out: Path) -> dict[str, Any]:
    """The flow file of a scene from its dump; the content of scene.json."""
    scene = SCENES[name](material)
    truth = truth_of(material, shape=scene.shape)
    fields, seen = fields_of(scene, dump)
    height, c = filled(scene, seen)
    origin: dict[str, float | str] = {"scene": name, "seed": SEED}
    flow = flow_of(scene, material, seen, c, height, truth, origin)
    write_flow(flow, out / FLOW)
    c = filled(scene, fields)[1]
    periodic = scene.period is not None
    found = reference(fields, c, scene.steady, periodic, scene.shape.bulk_density)
    own = own_law(found, truth)
    return {
        "scene": name,
        "title": scene.title,
        "material": material.friction,
        "seed": SEED,
        "frames": len(flow.t),
        "cells": [len(flow.y), len(flow.x)],
        "vectors": int(flow.valid.sum()),
        "share_flowing": float((found.inertial_number[found.used] > SLOWEST).mean()),
        "noise": found.noise,
        "truth": truth,
        "own": own,
        "balance": balance_of(flow, own["along_D"]),
        "side_walls": None if scene.view is None else side_walls(scene, dump, fields),
    }


def fields_of(scene: Scene, dump: Path) -> tuple[Fields, Fields]:
    """The fields that stress is taken from, and those that are seen: through a side wall and in a
    film they are others. Both have the same cells."""
    if scene.filmed:
        seen = coarse_grain(scene, snapshots(dump))
        mean = coarse_grain(dataclasses.replace(scene, frames=2), snapshots(dump))
        return cropped(mean, like=seen), cropped(seen)
    if scene.view is None:
        fields = cropped(coarse_grain(scene, snapshots(dump)))
        return fields, fields
    gap = float(scene.attributes["wall_gap"])
    fields, seen = (
        measured_bulk(coarse_grain(scene, slabs(dump, *between)))
        for between in ((0.0, gap), scene.view)
    )
    return cropped(fields), cropped(seen, like=fields)


def filled(scene: Scene, fields: Fields) -> tuple[Float64 | None, Float64]:
    """The surface line, [T, X], or None, and c of every cell, [T, Y, X]."""
    height = surface_height(fields) if scene.surface else None
    return height, fraction(fields, height)


def balance_of(flow: Flow, own: dict[str, Any]) -> dict[str, Any]:
    """The baseline, with its errors in % against the law of the scene."""
    made = baseline(flow, I0)
    found = dataclasses.asdict(made) | {"I_range": made.I_range}
    if found["mean"] is not None and own["mean"] is not None:
        mean, law = found["mean"], own["law"]
        mu = own["mean"]["mu"] if law is None else float(mu_of_i(law, mean["I"]))
        found["mean_error_percent"] = 100 * (mean["mu"] / mu - 1)
    return found


def line(summary: dict[str, Any]) -> str:
    """The scene in one line."""

    def law(found: dict[str, Any] | None) -> str:
        values, mean = ((found or {}).get(name) for name in ("law", "mean"))
        if values is not None:
            return f"{values['mu_s']:.3f}/{values['mu_2']:.3f}"
        return "     -     " if mean is None else f"{mean['mu']:.3f} at {mean['I']:.3f}"

    own = summary["own"]
    low, high = own["along_D"]["I_range"]
    ratio = own["dissipation_ratio"]
    return (
        f"{summary['scene']:<18} {summary['material']:g}  I {low:.3f}..{high:.3f}  "
        f"along D {law(own['along_D'])}  |tau| {law(own['norm'])}  "
        f"tau:D {np.nan if ratio is None else ratio:.3f}  balance {law(summary['balance'])}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, required=True, help="folder of the scenes")
    parser.add_argument("--lmp", help="the program LAMMPS")
    parser.add_argument("--only", nargs="+", help="SCENE-FRICTION")
    own = parser.parse_args()
    scenes = {f"{name}-{friction:g}": (name, friction) for name, friction in PACK}
    asked = own.only or scenes
    if unknown := set(asked) - set(scenes):
        parser.error(f"--only must be of {', '.join(scenes)}; got {', '.join(unknown)}")
    missing = [scenes[name] for name in asked if not (own.out / name / SUMMARY).exists()]
    try:
        names, frictions = zip(*missing, strict=True) if missing else ((), ())
        on_all_cores(made, names, frictions, repeat(own.out), repeat(own.lmp))
    except ExperimentError as error:
        print(f"bench.studies.grains.make: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
