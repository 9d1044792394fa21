"""Makes a scene of grains: LAMMPS, coarse-graining, flow file, its own law, baseline.

    python -m bench.studies.grains.make drum --material 0.4 --out scenes/drum-0.4

OUT/flow.h5 is the flow file, OUT/scene.json what the scene says of itself: its own law, the ratio
of its dissipation to that of the shear cell's law, its noise, and the law that the plain momentum
balance finds. `--keep` keeps the files of LAMMPS; with `--dump` an earlier dump is coarse-grained
again.

Defends: a scene is made in at most 15 minutes on one core.
"""

from __future__ import annotations

import argparse
import dataclasses
import shutil
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.coarse import Fields, coarse_grain
from bench.studies.grains.flow_file import cropped, flow_of
from bench.studies.grains.lammps import Lammps
from bench.studies.grains.law import SLOWEST, errors_percent, mu_of_i
from bench.studies.grains.materials import I0, Material, truth_of
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


def make(name: str, material: Material, seed: int, dump: Path, out: Path) -> dict[str, Any]:
    """The files of a scene from its dump; the content of scene.json."""
    scene = SCENES[name](material)
    truth = truth_of(material, shape=scene.shape)
    fields, seen = fields_of(scene, dump)
    height, c = filled(scene, seen)
    origin: dict[str, float | str] = {"scene": name, "seed": seed}
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
        "seed": seed,
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
    if found["law"] is not None and own["law"] is not None:
        found["error_percent"] = errors_percent(
            partial(mu_of_i, found["law"]), own["law"], *own["I_range"]
        )
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
    parser.add_argument("scene", choices=sorted(SCENES))
    parser.add_argument("--material", type=float, default=0.4, help="friction between the grains")
    parser.add_argument("--out", type=Path, required=True, help="folder for the files")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--lmp", help="the program LAMMPS")
    parser.add_argument("--keep", action="store_true", help="keep the files of LAMMPS")
    parser.add_argument("--dump", type=Path, help="coarse-grain this dump, without LAMMPS")
    own = parser.parse_args()
    material, work = Material(own.material), own.out / "lammps"
    own.out.mkdir(parents=True, exist_ok=True)
    try:
        scene = SCENES[own.scene](material)
        dump = own.dump or simulate(scene, material, own.seed, Lammps(own.lmp), work)
        summary = make(own.scene, material, own.seed, dump, own.out)
    except ExperimentError as error:
        print(f"bench.studies.grains.make: {error}", file=sys.stderr)
        return 1
    raw.write(own.out / SUMMARY, summary)
    if not own.keep and own.dump is None:
        shutil.rmtree(work)
    print(line(summary))
    return 0


if __name__ == "__main__":
    sys.exit(main())
