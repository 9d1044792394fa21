"""A collapse as tracked grains: `python -m bench.studies.experiment.tracks DIR --out FILE.json`.

A simulated collapse of known law is seen as disks in mm: at random places, some lost, velocities
with noise, no surface line. `convert` and `train` get the table alone. It writes the distance of
the traced surface from the true one, and the error of mu(I).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.experiment import commands
from granpinn import simulate
from granpinn.arrays import Float64
from granpinn.data import Flow, read_flow
from granpinn.data.surface import line_heights
from granpinn.results import Result, read_results

HEIGHT, GRAVITY, D = 0.5, 9.81, 5e-3  # m, m/s^2, m
LAW = 0.4, 0.64, 0.3  # mu_s, mu_2, I0
LOST, NOISE = 0.1, 0.01  # share of the grains; of the rms speed
MATERIAL = ("--grain-diameter", "5 mm", "--grain-density", "2500 kg/m^3", "--solid-fraction", "0.6")


def disks(flow: Flow, rng: np.random.Generator) -> Float64:
    """Rows t, x, y, u, v of the grains of all frames: a shaken hexagonal packing in each."""
    rows = []
    h = float(flow.x[1] - flow.x[0])
    speed = float(np.sqrt(np.nanmean(np.where(flow.material, flow.u**2 + flow.v**2, np.nan))))
    for k, t in enumerate(flow.t):
        up, along = np.arange(D / 2, flow.y[-1], 0.87 * D), np.arange(D / 2, flow.x[-1], D)
        y, x = np.meshgrid(up, along, indexing="ij")
        x = x + D / 2 * (np.arange(up.size) % 2)[:, None] + 0.1 * D * rng.normal(size=x.shape)
        y = y + 0.1 * D * rng.normal(size=x.shape)
        i = np.clip(np.rint((y - flow.y[0]) / h).astype(int), 0, flow.y.size - 1)
        j = np.clip(np.rint((x - flow.x[0]) / h).astype(int), 0, flow.x.size - 1)
        seen = flow.material[k][i, j] & (rng.random(x.shape) > LOST)
        noise = NOISE * speed * rng.normal(size=(2, seen.sum()))
        u, v = (a[k][i, j][seen] + e for a, e in zip((flow.u, flow.v), noise, strict=True))
        rows.append(np.column_stack([np.full(seen.sum(), t), x[seen], y[seen], u, v]))
    return np.concatenate(rows)


def score(true: Flow, flow: Flow, result: Result) -> dict[str, Any]:
    """Distance of the surface in d, and errors of mu in % at three I.

    Raises:
        commands.ExperimentError: the flow has no surface.
    """
    line = flow.surface
    if line is None or true.surface is None:
        raise commands.ExperimentError("convert traced no surface")
    places = true.x[true.x < line.x.max()]
    found, exact = (line_heights(true.t, places, s) for s in (line, true.surface))
    assert result.law.I_range is not None
    I = np.geomspace(*result.law.I_range, 3)
    assert true.truth is not None
    right = true.truth.friction_law.friction(I, *LAW)
    error = result.friction_law.friction(I, *result.theta) / right - 1
    return {
        "surface_d": round(float(np.nanmedian(found - exact)) / D, 2),
        "I": [float(f"{i:.2g}") for i in I],
        "errors": [round(100 * float(e), 2) for e in error],
        "theta": list(result.theta),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--steps", default="3000")
    parser.add_argument("--out", type=Path, help="the record")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    size: dict[str, Any] = {"height": HEIGHT, "aspect": 5.0, "d": D, "gravity": (0.0, -GRAVITY)}
    solver: dict[str, Any] = {"density": 1500.0, "cells": 256, "stride": 1, "frames": 60}
    mu_s, mu_2, _ = LAW
    true = simulate(mu_s=mu_s, mu_2=mu_2, **size, **solver, length_unit="m", time_unit="s")
    table = disks(true, np.random.default_rng(0)) * (1, 1e3, 1e3, 1e3, 1e3)
    tracks, flow, run = (options.folder / name for name in ("tracks.csv", "flow.h5", "run"))
    names = "t [s],x [mm],y [mm],u [mm/s],v [mm/s]"
    np.savetxt(tracks, table, delimiter=",", header=names, comments="", fmt="%.6g")
    python = [sys.executable, "-m"]
    print(commands.run([*python, "granpinn.convert", str(tracks), "--out", str(flow), *MATERIAL]))
    settings = ["--level", "V1", "--steps", options.steps]
    print(commands.run([*python, "granpinn.train", str(flow), "--out", str(run), *settings]))
    row = score(true, read_flow(flow), read_results(run / "results.json"))
    print(raw.write(options.out, {"steps": int(options.steps), "law": LAW, **row}))


if __name__ == "__main__":
    main()
