"""The Cramer-Rao bound: what no unbiased estimate from N noisy velocity vectors can beat.

python -m bench.studies.simulator_fit.bound --mu-s 0.6 --mu-2 0.84 --cells 512 --points 66000 \
    --noise 0.02 0.2 0.8 --json bound.json

Central differences of simulations at a known law give the sensitivities J, and these the least
standard deviation with white noise, I0 known or not. What bands and rounding add to the differences
would pass for information. It drops out of the product of the differences on two grids,
(J^T J' + J'^T J) / 2, and with it what the bands of one grid do say. So the truth lies between
J^T J ("one grid", too small a deviation) and that ("two grids", too large). Differences over more
of the law (--nudge 0.1) have less of it, which matters where I0 is unknown.
Neither the model error of a coarse grid nor an unknown initial state is in it.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.studies import raw
from granpinn.data import Flow, read_flow
from granpinn.data.noise import max_speed
from granpinn.physics.laws import DEFAULT
from granpinn.second_opinion.comparison import interpolation
from granpinn.second_opinion.scenes import collapse_of, initial_column
from granpinn.simulation import Collapse
from granpinn.simulation.progress import Silent
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.run import record

Array = npt.NDArray[np.float64]

NAMES = ("mu_s", "mu_2", "I0")
BOXES = (1.0, 1.03)  # sizes of the box, and so of the cells, relative to that of the collapse


def sensitivities(collapse: Collapse, nudge: float) -> tuple[Array, float]:
    """J = dv / d(log mu_s, log mu_2, log I0) [2, 2, n, 3] at all points and times, and max |v|.

    First axis: two realisations, on different grids; second: u and v.
    """
    full = collapse.resolved()
    assert full.t_end is not None  # resolved
    times = [full.t_end * k / full.frames for k in range(1, full.frames + 1)]
    width, height = full.box
    cores, runs = len(os.sched_getaffinity(0)), len(BOXES) * len(NAMES) * 2
    changed = [
        dataclasses.replace(
            collapse,
            threads=max(1, cores // runs),
            box_width=size * width,
            box_height=size * height,
            **{name: getattr(collapse, name) * (1 + sign * nudge)},
        )
        for size in BOXES
        for name in NAMES
        for sign in (1, -1)
    ]

    def simulated(collapse: Collapse) -> Flow:
        recorder = Recorder(collapse)
        record(recorder, Silent(), times)
        return recorder.flow()

    with ThreadPoolExecutor(min(cores, runs)) as pool:
        flows = list(pool.map(simulated, changed))
    at = [interpolation(flow, flows[0]) for flow in flows]
    v = [
        np.stack([[at_k(frame) for frame in field] for field in (flow.u, flow.v)])
        for at_k, flow in zip(at, flows, strict=True)
    ]
    common = np.isfinite(sum(v)).all(axis=0)
    J = [(v[k][:, common] - v[k + 1][:, common]) / (2 * nudge) for k in range(0, len(v), 2)]
    together = np.stack([np.stack(J[:3], axis=-1), np.stack(J[3:], axis=-1)])
    return together, max_speed(flows[0])


def bound(J: Array, speed: float, points: int, noise: float) -> dict[str, Any]:
    """Standard deviations in % from so many of the points, by products on one grid and on two."""
    scale = points / J.shape[2] / (noise * speed) ** 2
    pairs = {"one_grid": (J, J), "two_grids": (J, J[::-1])}
    found: dict[str, Any] = {"points": points, "noise": noise}
    for name, (first, second) in pairs.items():
        information = np.einsum("gcni,gcnj->ij", first, second) / len(J) * scale
        known, _ = _deviations(information[:2, :2])
        joint, covariance = _deviations(information)
        found[name] = {
            "mu_s_percent": known[0],
            "mu_2_percent": known[1],
            "joint_percent": dict(zip(NAMES, joint, strict=True)),
            "correlation_mu_2_I0": 1e4 * float(covariance[1, 2]) / (joint[1] * joint[2]),
        }
    return found


def _deviations(information: Array) -> tuple[list[float], Array]:
    """Standard deviations in % and the covariance; NaN where the information is none."""
    if np.linalg.eigvalsh(information).min() <= 0:
        return [math.nan] * len(information), np.full_like(information, math.nan)
    covariance = np.asarray(np.linalg.inv(information), np.float64)
    return [100 * math.sqrt(variance) for variance in np.diag(covariance)], covariance


def collapse_at(options: argparse.Namespace) -> Collapse:
    """The collapse of a flow file, or the paper's with the law of the command line."""
    flow = read_flow(options.flow) if options.flow else None
    truth = flow.truth if flow else None
    mu_s = options.mu_s or (truth.mu_s if truth else None)
    mu_2 = options.mu_2 or (truth.mu_2 if truth else None)
    if mu_s is None or mu_2 is None:
        raise SystemExit("bench.studies.simulator_fit.bound needs --mu-s and --mu-2, or a file's")
    if flow is None:
        cells = options.cells or Collapse.cells
        stride = max(1, round(cells / 128))
        return Collapse(mu_s, mu_2, I0=options.I0, cells=cells, stride=stride)
    column = initial_column(flow)
    if isinstance(column, str):
        raise SystemExit(f"{options.flow}: {column}")
    law = (mu_s, mu_2, (truth.I0 if truth else None) or options.I0)
    return collapse_of(flow, column, DEFAULT, law, options.cells)


def text(row: dict[str, Any]) -> str:
    """Two lines of a level of noise, one for each product."""
    lines = []
    for name in ("one_grid", "two_grids"):
        part = row[name]
        joint = "".join(f"{part['joint_percent'][n]:9.3f}" for n in NAMES)
        lines.append(
            f"{row['noise']:6.2f}{row['points']:9d}  {name:<10}{part['mu_s_percent']:10.3f}"
            f"{part['mu_2_percent']:9.3f}  {joint}"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flow", type=Path, nargs="?", help="a flow file; default: the paper's")
    parser.add_argument("--cells", type=int, help="of the simulations; default: the data's own")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.02, 0.2, 0.8], help="levels")
    parser.add_argument("--nudge", type=float, default=0.02, help="of the differences")
    parser.add_argument("--mu-s", type=float)
    parser.add_argument("--mu-2", type=float)
    parser.add_argument("--I0", type=float, default=0.3)
    parser.add_argument("--points", type=int, help="velocity vectors; default: all")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    collapse = collapse_at(options)
    J, speed = sensitivities(collapse, options.nudge)
    law = {"mu_s": collapse.mu_s, "mu_2": collapse.mu_2, "cells": collapse.cells}
    rows = [law | bound(J, speed, options.points or J.shape[2], sd) for sd in options.noise]
    raw.write(options.json, {"rows": rows})
    print(
        f"{'noise':>6}{'N':>9}  product of{'mu_s %':>10}{'mu_2 %':>9}   I0 unknown: mu_s, mu_2, I0"
    )
    print("\n".join(map(text, rows)))


if __name__ == "__main__":
    main()
