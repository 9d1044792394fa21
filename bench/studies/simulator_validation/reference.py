"""Compares simulated collapses with reference flow files of the same parameters and grid.

python -m bench.studies.simulator_validation.reference FILE.h5 ... --json reference.json

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

from bench.studies import raw
from bench.studies.simulator_validation.balance import (
    FLOWING,
    frames,
    merge,
    momentum_balance,
    regression,
)
from granpinn.data import Flow, read_flow
from granpinn.data.flow import SOLVER_CELL
from granpinn.figures.simulation import strain_rate
from granpinn.simulation import Collapse, Engine
from granpinn.simulation.recorder import Recorder

Array = npt.NDArray[np.float64]

BALANCE_TIMES = 24  # evenly spaced
BALANCE_INTERVAL = 0.025
FILM = 3  # rows of cells at the floor: the first few grains of the toe


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


def run(collapse: Collapse) -> tuple[Flow, list[Array]]:
    """The flow, and for every frame where its surface is in each row of cells (surface_of_rows)."""
    engine, recorder, surfaces = Engine(collapse), Recorder(collapse), []
    t_end = collapse.resolved().t_end
    assert t_end is not None  # resolved
    for k in range(1, collapse.frames + 1):
        time = t_end * k / collapse.frames
        while time - engine.time > 1e-9 * t_end:
            engine.step(time - engine.time)
        state = engine.state()
        recorder.add(time, state)
        surfaces.append(surface_of_rows(state.c))
    return recorder.flow(), surfaces


def surface_of_rows(c: Array) -> Array:
    """The foremost x, in cells, where c = 0.5 in every row [ny], interpolated; NaN: no grains."""
    places = np.full(len(c), np.nan)
    for j, row in enumerate(np.pad(c, ((0, 0), (0, 1)))):
        inside = np.flatnonzero(row > 0.5)
        if inside.size:
            i = int(inside[-1])
            places[j] = i + 0.5 + (row[i] - 0.5) / (row[i] - row[i + 1])
    return places


def front_distances(surfaces: list[Array], reference: Flow, spacing: float, film: int) -> Array:
    """How far the front is ahead of the reference's, in cells, in time.

    The grid of a reference file has every fourth cell, but its surface points are exact. Measured
    is the horizontal distance from its foremost surface point above the lowest `film` rows to
    the surface at the same height. Times at which the reference has no such point are left out.
    """
    points, distances = reference.surface, []
    assert points is not None
    x, rows = points.x / spacing, np.round(points.y / spacing - 0.5).astype(int)
    for time, surface in zip(reference.t, surfaces, strict=True):
        at_height = np.isclose(points.t, time) & (rows >= film) & (rows < len(surface))
        some = np.flatnonzero(at_height)
        some = some[np.isfinite(surface[rows[some]])]
        if some.size:
            foremost = some[np.argmax(x[some])]
            distances.append(surface[rows[foremost]] - x[foremost])
    return np.array(distances)


def differences(own: Flow, surfaces: list[Array], reference: Flow) -> dict[str, Any]:
    """Relative L2 of velocity and pressure where both hold grains, and the fronts."""
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
    cell = own.attributes[SOLVER_CELL]
    front = front_distances(surfaces, reference, cell, FILM)
    with_film = front_distances(surfaces, reference, cell, 0)
    return {
        "velocity": relative(velocity, common),
        "pressure": relative(pressure, common),
        "pressure_flowing": relative(pressure, common & (D2 > FLOWING)),
        "pressure_rest": relative(pressure, common & ~(D2 > FLOWING)),
        "front_cells_median": float(np.median(np.abs(front))),
        "front_cells_largest": float(np.abs(front).max()),
        "front_within_2_cells": float(np.mean(np.abs(front) <= 2)),
        "front_cells_last": float(front[-1]),
        "front_with_film_cells_median": float(np.median(np.abs(with_film))),
        "front_with_film_cells_largest": float(np.abs(with_film).max()),
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
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
                row |= differences(*run(collapse), reference)
            row |= balance(collapse)
            rows.append(row)
            print(json.dumps(row), flush=True)
    raw.write(options.json, {"rows": rows})


if __name__ == "__main__":
    main()
