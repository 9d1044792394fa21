r"""The yardstick that knows the initial state: fit the simulator; and the bound.

python -m bench.simulator_fit --bound --mu-s 0.6 --mu-2 0.84 --points 66000 --noise 0.02 0.2 0.8 \
    --cells 512 --json bound.json
python -m bench.simulator_fit FLOW.h5 ... --noise 0.2 0.8 --draws 20 --points 66000 \
    --against bound.json --json fit.json
python -m bench.simulator_fit FLOW.h5 --free-I0 --noise 0.02 --draws 20 --json I0.json

The fit is that of `granpinn.train --resimulate` (granpinn/second_opinion/simulator_fit.py), from
the same start for every flow and draw of the noise, I0 included where it is free; draws share the
runs. --against puts the bound of the same law beside the errors, the joint one where I0 is free.
--bound turns central
differences at a known law into the Cramer-Rao bound: the standard deviation that no unbiased
estimate from N velocity vectors with white noise can beat, I0 known or not. What bands and rounding
add to the differences would pass for information; it drops out of the product of the differences on
two grids, (J^T J' + J'^T J) / 2, with what the bands of one grid do know. So the truth lies between
J^T J ("one grid", too small a deviation) and that ("two grids", too large). Differences over more
of the law (--nudge 0.1) have less of it, which matters where I0 is unknown.
Neither the model error of a coarse grid nor an unknown initial state is in it.
Defends: nothing; it is what a method that may use the simulator reaches, with its time.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.machine import describe
from bench.noise_study import read_bounds, statistics, thinned, where_bounded
from granpinn.data import Flow, add_noise, read_flow
from granpinn.data.noise import max_speed
from granpinn.physics.laws import DEFAULT
from granpinn.results import plain
from granpinn.results.findings import SimulatorFit
from granpinn.second_opinion.comparison import interpolation
from granpinn.second_opinion.law_runs import LawRuns
from granpinn.second_opinion.resimulation import collapse_of, initial_column
from granpinn.second_opinion.simulator_fit import fit
from granpinn.simulation import Collapse
from granpinn.simulation.progress import Silent
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.run import record

Array = npt.NDArray[np.float64]

START = (0.3, 0.6)
START_I0 = 0.7  # of the true one, where it is free
NAMES = ("mu_s", "mu_2", "I0")
BOXES = (1.0, 1.03)  # sizes of the box, and so of the cells, relative to that of the collapse


def fit_draws(
    path: Path,
    noise: Sequence[float],
    draws: int,
    points: int,
    cells: int | None = None,
    free_I0: bool = False,
    start: tuple[float, float] = START,
) -> Iterator[dict[str, Any]]:
    """A row for every level of noise: errors and standard deviations of all draws in %."""
    flow = thinned(read_flow(path), points)
    truth = flow.truth
    if truth is None or truth.mu_s is None or truth.mu_2 is None:
        raise SystemExit(f"bench.simulator_fit: {path} must have true_mu_s and true_mu_2")
    column = initial_column(flow)
    if isinstance(column, str):
        raise SystemExit(f"bench.simulator_fit: {column}")
    I0 = truth.I0 or 0.3
    law = (truth.mu_s, truth.mu_2, I0)
    names = NAMES if free_I0 else NAMES[:2]
    runs = LawRuns(flow, column, START_I0 * I0 if free_I0 else I0, cells, free_I0)
    for sd in noise:
        begin = time.monotonic()

        def draw(seed: int, sd: float = sd) -> SimulatorFit:
            return fit(add_noise(flow, sd, seed), runs, start)

        with ThreadPoolExecutor(draws) as pool:  # each waits for its runs, which all cores make
            found = list(pool.map(draw, range(draws)))
        values = np.array([(f.mu_s, f.mu_2, f.I0 or I0) for f in found])[:, : len(names)]
        stds = np.array([(*f.std, f.I0_std or 0.0) for f in found])[:, : len(names)]
        errors = 100 * (values / law[: len(names)] - 1)
        correlations = [f.correlation for f in found if f.correlation is not None]
        yield {
            "flow": path.name,
            **dict(zip(NAMES, law, strict=True)),
            "noise": sd,
            "points": len(runs.points),
            "cells": found[0].cells,
            "start": (*start, runs.I0),
            "names": names,
            "draws_percent": errors.tolist(),
            "std_percent": (100 * stds / law[: len(names)]).tolist(),
            "errors_percent": {n: statistics(errors[:, k].tolist()) for k, n in enumerate(names)},
            "correlation_mu_2_I0": float(np.mean(correlations)) if correlations else None,
            "misfit_percent": found[0].misfit_percent,
            "inside": sum(f.inside for f in found),
            "runs": runs.made,
            "seconds": time.monotonic() - begin,
        }


def with_bounds(
    rows: Sequence[dict[str, Any]], bounds: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Rows with the bound in % and the ratio of the RMSE to it, where their law is known."""

    def compared(known: dict[str, Any], factor: float, rmse: dict[str, float]) -> dict[str, Any]:
        grid = known["one_grid"]
        joint = grid["joint_percent"] if "I0" in rmse else {n: grid[f"{n}_percent"] for n in rmse}
        least = {n: joint[n] * factor for n in rmse}
        ratios = {n: rmse[n] / least[n] if least[n] else None for n in rmse}
        return {"bound_percent": least, "rmse_over_bound": ratios}

    return where_bounded(rows, bounds, compared)


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


def bounds(options: argparse.Namespace) -> list[dict[str, Any]]:
    """The bound at every level of noise, printed."""
    flow = read_flow(options.flows[0]) if options.flows else None
    truth = flow.truth if flow else None
    mu_s = options.mu_s or (truth.mu_s if truth else None)
    mu_2 = options.mu_2 or (truth.mu_2 if truth else None)
    if mu_s is None or mu_2 is None:
        raise SystemExit("bench.simulator_fit: --bound needs --mu-s and --mu-2, or a file's own")
    if flow is None:
        cells = options.cells or Collapse.cells
        stride = max(1, round(cells / 128))
        collapse = Collapse(mu_s, mu_2, I0=options.I0, cells=cells, stride=stride)
    else:
        column = initial_column(flow)
        if isinstance(column, str):
            raise SystemExit(f"bench.simulator_fit: {column}")
        law = (mu_s, mu_2, (truth.I0 if truth else None) or options.I0)
        collapse = collapse_of(flow, column, DEFAULT, law, options.cells)
    J, speed = sensitivities(collapse, options.nudge)
    rows = []
    print(
        f"{'noise':>6}{'N':>9}  product of{'mu_s %':>10}{'mu_2 %':>9}   I0 unknown: mu_s, mu_2, I0"
    )
    for noise in options.noise or (0.02, 0.2, 0.8):
        row = bound(J, speed, options.points or J.shape[2], noise)
        for name in ("one_grid", "two_grids"):
            part = row[name]
            joint = "".join(f"{part['joint_percent'][n]:9.3f}" for n in NAMES)
            print(
                f"{noise:6.2f}{row['points']:9d}  {name:<10}{part['mu_s_percent']:10.3f}"
                f"{part['mu_2_percent']:9.3f}  {joint}"
            )
        rows.append({"mu_s": mu_s, "mu_2": mu_2, "cells": collapse.cells, **row})
    return rows


def fits(options: argparse.Namespace) -> None:
    """The fits of every file at every level of noise, printed and saved one after the other."""
    rows: list[dict[str, Any]] = []
    known = read_bounds(options.against)
    for path in options.flows:
        draws = options.draws if options.noise else 1
        levels, points = options.noise or (0.0,), options.points or 0
        start = tuple(options.start)
        for row in fit_draws(path, levels, draws, points, options.cells, options.free_I0, start):
            rows += with_bounds([row], known)
            print(text(rows[-1], draws), flush=True)
            save(options.json, rows)


def save(path: Path | None, rows: Sequence[dict[str, Any]]) -> None:
    """Writes the rows that there are, so that what ends early leaves some."""
    if path:
        path.write_text(json.dumps(plain({"machine": describe(), "rows": rows}), indent=1) + "\n")


def text(row: dict[str, Any], draws: int) -> str:
    """RMSE (bias) and its ratio to the bound for every unknown; of one draw it is the error."""
    parts = []
    for k, name in enumerate(row["names"]):
        s = row["errors_percent"][name]
        part = f"{name} {s['rmse']:.2f} ({s['bias']:+.2f})"
        if draws == 1:
            part = f"{name} {row['draws_percent'][0][k]:+.2f}"
        ratio = row.get("rmse_over_bound", {}).get(name)
        parts.append(part if ratio is None else f"{part} = {ratio:.2f} x bound")
    return (
        f"{row['flow']} noise {row['noise']:.2f}, {row['points']} vectors, {row['cells']} cells: "
        f"{', '.join(parts)} %; {row['inside']} of {draws} enclosed, {row['runs']} runs, "
        f"{row['seconds']:.0f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flows", type=Path, nargs="*", help="flow files")
    parser.add_argument("--cells", type=int, help="of the simulations; default: the data's own")
    parser.add_argument("--start", type=float, nargs=2, default=START, help="mu_s and mu_2")
    parser.add_argument("--free-I0", action="store_true", help="fit I0 too")
    parser.add_argument("--against", type=Path, nargs="+", default=[], help="files of --bound")
    parser.add_argument("--noise", type=float, nargs="+", help="sd relative to the largest speed")
    parser.add_argument("--draws", type=int, default=1, help="of the noise, at each level")
    parser.add_argument("--nudge", type=float, default=0.02, help="of the bound's differences")
    parser.add_argument(
        "--bound", action="store_true", help="the Cramer-Rao bound instead of a fit"
    )
    parser.add_argument("--mu-s", type=float)
    parser.add_argument("--mu-2", type=float)
    parser.add_argument("--I0", type=float, default=0.3)
    parser.add_argument("--points", type=int, help="velocity vectors; default: all")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    if not options.flows and not options.bound:
        parser.error("give a flow file, or --bound")
    if options.bound:
        save(options.json, bounds(options))
    else:
        fits(options)


if __name__ == "__main__":
    main()
