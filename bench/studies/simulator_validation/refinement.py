"""What changes when the grid of a collapse is refined: velocity, pressure, front, shear bands.

python -m bench.studies.simulator_validation.refinement --case 0.6 0.84 --json refinement.json

Runs on several grids are compared with the finest, as means over the cells of a grid of 128.
Shear bands: the share of the area of the grains that carries half of their strain. In a flow that
is resolved it does not depend on the grid; bands one cell thick halve it with every refinement.
Defends: fields of mu_s <= 0.4 change by less than 2 % from 256 cells on.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.studies import raw
from bench.studies.simulator_validation.reference import surface_of_rows
from granpinn.simulation import Collapse, Engine, State

Array = npt.NDArray[np.float64]

COARSE = 128  # cells across the (square) box of the grid of the comparison
INTERVAL = 0.25  # between the times of the comparison
HEIGHT = 0.1  # at which the front is measured, above the film at the floor
PURE = 0.999  # mean fraction of a coarse cell that holds nothing but grains


class Run(NamedTuple):
    """Means over the coarse grid [T, 128, 128] (fraction, and u, v, p of the grains), fronts [T],
    localised shares [T], and what the run cost.
    """

    c: Array
    u: Array
    v: Array
    p: Array
    front: Array
    localised: Array
    cost: dict[str, Any]


def run(collapse: Collapse) -> Run:
    engine, s = Engine(collapse), collapse.resolved()
    assert s.t_end is not None  # resolved
    begin, reports, samples = time.process_time(), [], []
    for moment in np.arange(INTERVAL, s.t_end + 1e-9, INTERVAL):
        while moment - engine.time > 1e-9:
            reports.append(engine.step(moment - engine.time))
        samples.append(sample(engine.state(), s.spacing, s.cells // COARSE))
    cpu = time.process_time() - begin
    cost = {
        "steps": len(reports),
        "cpu_s": round(cpu, 1),
        "cpu_us_per_cell_and_step": round(
            cpu / sum(r.window[0] * r.window[1] for r in reports) * 1e6, 3
        ),
        "most_iterations": max(max(r.viscous_iterations, r.pressure_iterations) for r in reports),
    }
    c, u, v, p, front, share = (np.array(part) for part in zip(*samples, strict=True))
    return Run(c, u, v, p, front, share, cost)


def sample(state: State, h: float, factor: int) -> tuple[Array | float, ...]:
    """What Run has of one time."""

    def means(field: Array) -> Array:
        whole = np.zeros((COARSE * factor, COARSE * factor))
        whole[: field.shape[0], : field.shape[1]] = field
        mean: Array = whole.reshape(COARSE, factor, COARSE, factor).mean(axis=(1, 3))
        return mean

    front = float(surface_of_rows(state.c)[round(HEIGHT / h)] * h)
    flow = (state.u_center, state.v_center, state.p)
    shares = (front, localised(state, h))
    return (means(state.c), *(means(state.c * field) for field in flow), *shares)


def localised(state: State, h: float) -> float:
    """The share of the grains' area that carries half of their strain (the sum of D2)."""
    u_y, u_x = np.gradient(state.u_center, h)
    v_y, v_x = np.gradient(state.v_center, h)
    D2 = np.sqrt(u_x**2 + v_y**2 + 0.5 * (u_y + v_x) ** 2)[state.c == 1]
    strain = np.cumsum(np.sort(D2)[::-1])
    return float(np.searchsorted(strain, 0.5 * strain[-1]) / len(strain))


def compare(run: Run, finest: Run) -> dict[str, Any]:
    both = (run.c > PURE) & (finest.c > PURE)

    def relative(pairs: list[tuple[Array, Array]]) -> float:
        top = sum(float(((a - b)[both] ** 2).sum()) for a, b in pairs)
        return float(np.sqrt(top / sum(float((b[both] ** 2).sum()) for _, b in pairs)))

    return {
        "velocity": relative([(run.u, finest.u), (run.v, finest.v)]),
        "pressure": relative([(run.p, finest.p)]),
        "front_last": float(run.front[-1]),
        "front_difference_largest": float(np.abs(run.front - finest.front).max()),
        "localised_mean": float(run.localised.mean()),
        **run.cost,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--case", type=float, nargs=2, action="append", required=True)
    parser.add_argument("--cells", type=int, nargs="+", default=[128, 256, 512])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    if any(cells % COARSE for cells in options.cells):
        parser.error(f"--cells must be multiples of {COARSE}, got {options.cells}")
    rows = []
    for mu_s, mu_2 in options.case:
        runs = {
            cells: run(Collapse(mu_s=mu_s, mu_2=mu_2, cells=cells, threads=1))
            for cells in options.cells
        }
        for cells in options.cells:
            result = compare(runs[cells], runs[max(runs)])
            rows.append({"case": f"{mu_s:.2f} {mu_2:.2f}", "cells": cells, **result})
            print(json.dumps(rows[-1]), flush=True)
    raw.write(options.json, {"rows": rows})


if __name__ == "__main__":
    main()
