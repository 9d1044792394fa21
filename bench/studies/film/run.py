"""Film against truth: python -m bench.studies.film.run SCENE... --out FOLDER

A scene is KIND_SEED_GRAIN, such as collapse_401_6. For each, the film is rendered, measured with
`granpinn.film`, and compared with the simulation. Rows go to FOLDER/rows.csv, the flow of the film
to SCENE_film.h5, and the true vectors at its places and times to SCENE_true.h5; laws.py takes them.

Defends: 68 % of the vectors are within one standard deviation, the surface within half a grain.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from bench.studies.film import render, scenes
from granpinn.data import Flow, write_flow
from granpinn.filming import FilmSettings
from granpinn.filming.measurement import measure

NEAR = 3.0  # grain diameters from the surface or a wall


def measured(name: str, folder: Path) -> tuple[scenes.Scene, Flow, dict[str, Any]]:
    """A scene, the flow of its film, and a row of the table."""
    scene = scenes.named(name)
    shot = scene.shot
    frames = folder / name
    if len([*frames.glob("*.png")]) < shot.frames:
        render.write(scene.field, shot, frames)
    begin = time.monotonic()
    found = measure(str(frames / "*.png"), FilmSettings(**scene.settings()))
    seconds = time.monotonic() - begin
    flow, line = found.flow, found.line
    particles = flow.particles
    assert particles is not None
    assert line is not None
    row: dict[str, Any] = {"scene": name, "vectors": particles.u.size, "seconds": round(seconds, 1)}
    row["release_frames"] = round((found.released or 0.0) + shot.first, 2)
    errors, sds, speeds, aboves, walls = [], [], [], [], []
    for number in found.pictures:
        good = found.vectors[found.vectors.good & (found.vectors.t == number)]
        t = (number + shot.first) / shot.rate
        x = (good.x.to_numpy() + 0.5) * shot.pixel
        y = (shot.rows - good.y.to_numpy() - 0.5) * shot.pixel
        u, v = scene.field.velocity(t, x, y) / (shot.pixel * shot.rate)
        errors += [good.u - u, good.v + v]
        sds += [good.sd, good.sd]
        now = line.t == number
        tree = cKDTree(np.stack([line.x[now], line.y[now]], -1))
        above = tree.query(np.stack([good.x, shot.rows - good.y], -1))[0] / shot.grain
        wall = np.minimum(shot.rows - good.y, good.x if shot.period is None else np.inf)
        speeds += [np.hypot(u, v)] * 2
        aboves += [above] * 2
        walls += [wall / shot.grain] * 2
        fraction = _offset(scene, line.x[now], line.y[now], t)
        row.setdefault("surface_grains", []).append(fraction)
    error, sd, speed, above, wall = map(np.concatenate, (errors, sds, speeds, aboves, walls))
    within = np.abs(error) < sd
    slow, fast = np.quantile(speed, (1 / 3, 2 / 3))
    parts = {
        "slow": speed < slow,
        "fast": speed > fast,
        "surface": above < NEAR,
        "wall": wall < NEAR,
    }
    row["rms_over_speed"] = round(float(np.sqrt(np.mean(error**2) / np.mean(speed**2) * 2)), 4)
    row["within_all"] = round(float(within.mean()), 3)
    row |= {f"within_{k}": round(float(within[m].mean()), 3) for k, m in parts.items()}
    row["surface_grains"] = round(float(np.mean(row["surface_grains"])), 3)
    return scene, flow, row


def _offset(scene: scenes.Scene, x: Any, y: Any, t: float) -> float:
    """Median height of the traced line above c = 1/2 of the simulation, grain diameters."""
    shot = scene.shot
    heights = np.arange(-4, 4.01, 0.1) * shot.grain
    offsets = []
    for column, height in zip(x, y, strict=True):
        place = (height + heights) * shot.pixel
        c = scene.field.fraction(t, np.full(place.size, column * shot.pixel), place)
        if c[0] > 0.5 > c[-1]:
            offsets.append(-float(np.interp(0.5, c[::-1], heights[::-1])))
    return float(np.median(offsets)) / shot.grain


def true_flow(scene: scenes.Scene, flow: Flow, release: float) -> Flow:
    """The flow with the velocity of the simulation in the place of the measured one.

    Args:
        release: the release that was found, frames after the true one.
    """
    p = flow.particles
    assert p is not None
    u, v = scene.true_velocity(p.t + release / scene.shot.rate, p.x, p.y)
    exact = dataclasses.replace(p, u=u, v=v, sigma_u=None, sigma_v=None)
    return dataclasses.replace(flow, particles=exact)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    own = parser.parse_args()
    rows = []
    for name in own.scenes:
        scene, flow, row = measured(name, own.out)
        flow = dataclasses.replace(flow, truth=scene.flow.truth)
        write_flow(flow, own.out / f"{name}_film.h5")
        write_flow(true_flow(scene, flow, row["release_frames"]), own.out / f"{name}_true.h5")
        print(row, flush=True)
        rows.append(row)
        pd.DataFrame(rows).to_csv(own.out / "rows.csv", index=False)


if __name__ == "__main__":
    main()
