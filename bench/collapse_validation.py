"""Compares simulated collapses with reference flow files of the same parameters and grid.

python -m bench.collapse_validation FILE.h5 ... --json bench/results/collapse_validation.json

Defends: at the resolution of the reference solver, velocity within 3 % and pressure within 6 % in
relative L2 for mu_s <= 0.4, a front within 2 cells, and an output that obeys its own momentum
balance well enough to return mu_s to 0.3 % and mu_2 to 1 % by regression.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.collapse_residual import FLOWING, frames, merge, momentum_balance, regression
from bench.machine import describe
from granpinn.data import Flow, read_flow
from granpinn.simulation import Collapse, simulate
from granpinn.simulation.figures import strain_rate

Array = npt.NDArray[np.float64]

BALANCE_TIMES = 24  # evenly spaced
BALANCE_INTERVAL = 0.025


def collapse_of(reference: Flow, cells: int, threads: int) -> Collapse:
    """The collapse that a reference file shows, with every fourth point of 512 cells."""
    assert reference.truth is not None
    truth, facts = reference.truth, reference.attributes
    assert truth.mu_s is not None
    assert truth.mu_2 is not None
    return Collapse(
        mu_s=truth.mu_s,
        mu_2=truth.mu_2,
        I0=truth.I0 or 0.3,
        d=reference.grain_diameter,
        height=facts["column_height"],
        aspect=facts["column_height"] / facts["column_width"],
        box_width=facts["domain_size"],
        box_height=facts["domain_size"],
        cells=cells,
        stride=cells // 128,
        t_end=float(reference.t[-1]),
        frames=len(reference.t),
        threads=threads,
    )


def fronts(flow: Flow) -> Array:
    """Where the fullest cell of a column is half full, by linear interpolation, in time [T]."""
    places = []
    for c in flow.c.max(axis=1):
        i = int(np.flatnonzero(c > 0.5).max())
        after = c[i + 1] if i + 1 < len(c) else 0.0
        step = flow.x[1] - flow.x[0]
        places.append(flow.x[i] + step * (c[i] - 0.5) / (c[i] - after))
    return np.array(places)


def differences(own: Flow, reference: Flow) -> dict[str, Any]:
    """Relative L2 of velocity and pressure on the points that hold grains in both."""
    assert own.p is not None
    assert reference.p is not None
    ny, nx = np.minimum(own.c.shape[1:], reference.c.shape[1:])
    cut = np.s_[:, :ny, :nx]
    common = own.valid[cut] & reference.valid[cut]
    D2 = np.stack([strain_rate(reference, k) for k in range(len(reference.t))])[cut]

    def relative(pairs: list[tuple[Any, Any]], where: Any) -> float:
        top = sum(float(((a[cut] - b[cut])[where] ** 2).sum()) for a, b in pairs)
        return float(np.sqrt(top / sum(float((b[cut][where] ** 2).sum()) for _, b in pairs)))

    velocity = [(own.u, reference.u), (own.v, reference.v)]
    pressure = [(own.p, reference.p)]
    cell = own.attributes["grid_spacing_of_solver"]
    front = np.abs(fronts(own) - fronts(reference)) / cell
    return {
        "velocity": relative(velocity, common),
        "pressure": relative(pressure, common),
        "pressure_flowing": relative(pressure, common & (D2 > FLOWING)),
        "pressure_rest": relative(pressure, common & ~(D2 > FLOWING)),
        "front_cells_median": float(np.median(front)),
        "front_cells_largest": float(front.max()),
        "front_relative_last": float(fronts(own)[-1] / fronts(reference)[-1] - 1),
    }


def balance(collapse: Collapse) -> dict[str, Any]:
    """Momentum residual at the true parameters, in units of g, and what a regression returns."""
    t_end = collapse.resolved().t_end
    assert t_end is not None
    times = t_end * np.arange(1, BALANCE_TIMES + 1) / (BALANCE_TIMES + 1)
    triples = frames(collapse, times.tolist(), BALANCE_INTERVAL)
    found = merge([momentum_balance(triple, collapse) for triple in triples])
    mu_s, mu_2 = regression(found)
    return {
        "residual_median": float(np.median(found.residual)),
        "residual_95": float(np.quantile(found.residual, 0.95)),
        "points": len(found.residual),
        "mu_s_error": mu_s / collapse.mu_s - 1,
        "mu_2_error": mu_2 / collapse.mu_2 - 1,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("references", type=Path, nargs="+")
    parser.add_argument("--cells", type=int, nargs="+", default=[512])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for path in options.references:
        reference = read_flow(path)
        for cells in options.cells:
            collapse = collapse_of(reference, cells, options.threads)
            row = {"case": f"{collapse.mu_s:.2f} {collapse.mu_2:.2f}", "cells": cells}
            if cells % 512 == 0:  # the cell centers are then those of the reference, or near
                row |= differences(simulate(collapse), reference)
            row |= balance(collapse)
            rows.append(row)
            print(json.dumps(row), flush=True)
    if options.json:
        options.json.write_text(json.dumps({"machine": describe(), "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
