r"""The yardstick that knows the initial state: fit the simulator, by Gauss-Newton on its runs.

python -m bench.simulator_fit FLOW.h5 --cells 128 --json fit.json
python -m bench.simulator_fit --bound --mu-s 0.6 --mu-2 0.84 --points 66000 --noise 0.02 0.2 0.8

An iteration simulates three collapses side by side, with (mu_s, mu_2) and with either a little
larger, and moves along the least-squares step of the velocity at the points that all have:

    (J^T J) delta = J^T (v_observed - v),  J = dv / d(log mu_s, log(mu_2 - mu_s)).

The law with the least misfit is the result: near the end the differences are those of bands and
of the toe, which no small step makes smaller. --bound turns central differences at a known law into
the Cramer-Rao bound: the standard deviation that no unbiased estimate from N velocity vectors with
white noise can beat, I0 known or not. What bands and rounding add to the differences would pass for
information; it drops out of the product of the differences on two grids, (J^T J' + J'^T J) / 2,
with what the bands of one grid do know. So the truth lies between J^T J ("one grid", too small a
deviation) and that ("two grids", too large).
Neither the model error of a coarse grid nor an unknown initial state is in it.
Defends: nothing; it is what a method that may use the simulator reaches, with its time.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.machine import describe
from granpinn.data import Flow, add_noise, read_flow
from granpinn.data.noise import max_speed
from granpinn.identification.comparison import interpolation
from granpinn.identification.resimulation import Column, collapse_of, initial_column
from granpinn.results import plain
from granpinn.simulation import Collapse
from granpinn.simulation.progress import Silent
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.run import record

Array = npt.NDArray[np.float64]

START = (0.3, 0.6)
ENOUGH = 5e-3  # relative fall of the misfit over so many iterations below which the fit ends
PATIENCE = 2
LONGEST_STEP = 0.5
NAMES = ("mu_s", "mu_2", "I0")
BOXES = (1.0, 1.03)  # sizes of the box, and so of the cells, relative to that of the collapse


def laws(q: Array) -> tuple[float, float]:
    """(mu_s, mu_2) at q = (log mu_s, log(mu_2 - mu_s))."""
    return math.exp(q[0]), math.exp(q[0]) + math.exp(q[1])


def run_all(collapses: Sequence[Collapse], times: Sequence[float]) -> list[Flow]:
    """Simulate side by side on all cores."""
    cores = len(os.sched_getaffinity(0))
    threads = max(1, cores // len(collapses))

    def one(collapse: Collapse) -> Flow:
        recorder = Recorder(dataclasses.replace(collapse, threads=threads))
        record(recorder, Silent(), times)
        return recorder.flow()

    with ThreadPoolExecutor(min(cores, len(collapses))) as pool:
        return list(pool.map(one, collapses))


def at_data(simulated: Flow, flow: Flow) -> Array:
    """The simulated velocity at the points of the data [2, T, Y, X]; NaN where there is none."""
    at = interpolation(simulated, flow)
    return np.stack([[at(frame) for frame in field] for field in (simulated.u, simulated.v)])


def fit(flow: Flow, cells: int, iterations: int, nudge: float) -> dict[str, Any]:
    """mu_s and mu_2 of a flow, with the course of the fit."""
    column = initial_column(flow)
    if isinstance(column, str):
        raise SystemExit(f"bench.simulator_fit: {column}")
    begin = time.monotonic()
    I0 = (flow.truth.I0 if flow.truth else None) or 0.3
    data = np.where(flow.valid, np.stack([flow.u, flow.v]), np.nan).astype(np.float64)
    q = np.log([START[0], START[1] - START[0]])
    course = []
    for _ in range(iterations):
        around = [q, q + np.array([nudge, 0.0]), q + np.array([0.0, nudge])]
        collapses = [_collapse(flow, column, laws(each), I0, cells) for each in around]
        v = [at_data(s, flow) for s in run_all(collapses, flow.t.tolist())]
        common = np.isfinite(sum(v) + data)
        J = np.stack([(other - v[0])[common] / nudge for other in v[1:]], axis=1)
        misfit = (data - v[0])[common]
        delta = np.linalg.lstsq(J, misfit, rcond=None)[0]
        delta *= min(1.0, LONGEST_STEP / float(np.abs(delta).max()))
        mu_s, mu_2 = laws(q)
        share = 100 * float(np.linalg.norm(misfit) / np.linalg.norm(data[common]))
        course.append({"mu_s": mu_s, "mu_2": mu_2, "misfit_percent": share})
        print(f"mu_s {mu_s:.4f}  mu_2 {mu_2:.4f}  misfit {share:.2f} %", file=sys.stderr)
        q = q + delta
        least = [min(c["misfit_percent"] for c in course[: k + 1]) for k in range(len(course))]
        if len(course) > PATIENCE and least[-1] > (1 - ENOUGH) * least[-1 - PATIENCE]:
            break
    best = min(course, key=lambda c: c["misfit_percent"])
    mu_s, mu_2 = best["mu_s"], best["mu_2"]
    row: dict[str, Any] = {"mu_s": mu_s, "mu_2": mu_2, "cells": cells, "course": course}
    if flow.truth is not None and flow.truth.mu_s and flow.truth.mu_2:
        row["error_mu_s_percent"] = 100 * (mu_s / flow.truth.mu_s - 1)
        row["error_mu_2_percent"] = 100 * (mu_2 / flow.truth.mu_2 - 1)
    return row | {"runs": 3 * len(course), "seconds": time.monotonic() - begin}


def _collapse(
    flow: Flow, column: Column, law: tuple[float, float], I0: float, cells: int
) -> Collapse:
    return collapse_of(flow, column, (*law, I0), cells)


def sensitivities(collapse: Collapse, nudge: float) -> tuple[Array, float]:
    """J = dv / d(log mu_s, log mu_2, log I0) [2, 2, n, 3] at all points and times, and max |v|.

    First axis: two realisations, on different grids; second: u and v.
    """
    full = collapse.resolved()
    assert full.t_end is not None  # resolved
    times = [full.t_end * k / full.frames for k in range(1, full.frames + 1)]
    width, height = full.box
    changed = [
        dataclasses.replace(
            collapse,
            box_width=size * width,
            box_height=size * height,
            **{name: getattr(collapse, name) * (1 + sign * nudge)},
        )
        for size in BOXES
        for name in NAMES
        for sign in (1, -1)
    ]
    flows = run_all(changed, times)
    v = [at_data(flow, flows[0]) for flow in flows]
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
        stride = max(1, round(options.cells / 128))
        collapse = Collapse(mu_s, mu_2, I0=options.I0, cells=options.cells, stride=stride)
    else:
        column = initial_column(flow)
        if isinstance(column, str):
            raise SystemExit(f"bench.simulator_fit: {column}")
        law = (mu_s, mu_2, (truth.I0 if truth else None) or options.I0)
        collapse = collapse_of(flow, column, law, options.cells)
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
        rows.append({"mu_s": mu_s, "mu_2": mu_2, "cells": options.cells, **row})
    return rows


def fits(options: argparse.Namespace) -> list[dict[str, Any]]:
    """The fit of every file at every level of noise, printed."""
    rows = []
    for path in options.flows:
        for noise in options.noise or (0.0,):
            flow = add_noise(read_flow(path), noise, options.seed)
            row = fit(flow, options.cells, options.iterations, options.nudge)
            errors = [row.get(f"error_{n}_percent", math.nan) for n in ("mu_s", "mu_2")]
            print(
                f"{path.name:<28} noise {noise:.2f}  mu_s {row['mu_s']:.4f} ({errors[0]:+.2f} %)  "
                f"mu_2 {row['mu_2']:.4f} ({errors[1]:+.2f} %)  {row['runs']} runs, "
                f"{row['seconds']:.0f} s",
                flush=True,
            )
            rows.append({"flow": path.name, "noise": noise, **row})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("flows", type=Path, nargs="*", help="flow files")
    parser.add_argument("--cells", type=int, default=128, help="of the simulations")
    parser.add_argument("--noise", type=float, nargs="+", help="sd relative to the largest speed")
    parser.add_argument("--seed", type=int, default=0, help="of the noise")
    parser.add_argument("--iterations", type=int, default=10, help="at most")
    parser.add_argument("--nudge", type=float, default=0.02, help="relative change of a parameter")
    parser.add_argument(
        "--bound", action="store_true", help="the Cramer-Rao bound instead of a fit"
    )
    parser.add_argument("--mu-s", type=float)
    parser.add_argument("--mu-2", type=float)
    parser.add_argument("--I0", type=float, default=0.3)
    parser.add_argument("--points", type=int, help="velocity vectors; default: those of the run")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    if not options.flows and not options.bound:
        parser.error("give a flow file, or --bound")
    rows = bounds(options) if options.bound else fits(options)
    if options.json:
        options.json.write_text(
            json.dumps(plain({"machine": describe(), "rows": rows}), indent=1) + "\n"
        )


if __name__ == "__main__":
    main()
