"""The yardstick that uses the initial state: the simulator itself, fitted to the velocity.

python -m bench.studies.simulator_fit.run FLOW.h5 ... --noise 0.2 0.8 --draws 20 --points 66000 \
    --against bound.json --json fit.json
python -m bench.studies.simulator_fit.run FLOW.h5 --free-I0 --noise 0.02 --draws 20 --json I0.json

The fit is that of `granpinn.train --resimulate` (granpinn/second_opinion/simulator_fit.py), from
the same start for every flow and draw of the noise, I0 included where it is free; draws share the
runs. --against puts the bound of the same law (bench.studies.simulator_fit.bound) beside the
errors, the joint one where I0 is free.
Defends: nothing; it is what a method that may use the simulator reaches, with its time.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from bench.studies.draws import read_bounds, statistics, thinned, with_bounds
from granpinn.checks.simulator_fit import SimulatorFit, fit
from granpinn.data import add_noise, read_flow
from granpinn.second_opinion.law_runs import LawRuns
from granpinn.second_opinion.scenes import initial_column

START = (0.3, 0.6)
START_I0 = 0.7  # of the true one, where it is free
NAMES = ("mu_s", "mu_2", "I0")


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
        raise SystemExit(f"{path} must have true_mu_s and true_mu_2: errors need them, got none")
    column = initial_column(flow)
    if isinstance(column, str):
        raise SystemExit(f"{path}: {column}")
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
            raw.write(options.json, {"rows": rows})  # after every row: what ends early leaves some


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
    parser.add_argument("flows", type=Path, nargs="+", help="flow files")
    parser.add_argument("--cells", type=int, help="of the simulations; default: the data's own")
    parser.add_argument("--start", type=float, nargs=2, default=START, help="mu_s and mu_2")
    parser.add_argument("--free-I0", action="store_true", help="fit I0 too")
    parser.add_argument("--against", type=Path, nargs="+", default=[], help="files of the bound")
    parser.add_argument("--noise", type=float, nargs="+", help="sd relative to the largest speed")
    parser.add_argument("--draws", type=int, default=1, help="of the noise, at each level")
    parser.add_argument("--points", type=int, help="velocity vectors; default: all")
    parser.add_argument("--json", type=Path)
    fits(parser.parse_args())


if __name__ == "__main__":
    main()
