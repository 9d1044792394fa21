"""Run-out and final profile of collapses against discrete simulations and the scaling of mu(I).

python -m bench.studies.simulator_validation.runout PROFILE_DIR --json runout.json

PROFILE_DIR holds ShapeTime.A-*.dat of Staron and Hinch (2005): two-sided collapses of disks, with
columns x/d and h/d, profiles separated by blank lines. The material is that with which Lagree,
Staron and Popinet (2011) match them in a mu(I) continuum: mu_s = 0.32, mu_2 = 0.60, I0 = 0.4, for
which they give (L - R0)/R0 = 2.2 a (a < 7) and 3.9 a^0.7 (a > 7). Where a layer ends is measured
twice, the same for both: where it is thinner than one grain, and, without the film of single grains
that a continuum cannot describe, than three.
Defends: profiles at the end within 3 % of the initial height (rms), run-outs within 20 % of the
disks.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.studies import raw
from granpinn.simulation import Collapse, simulate

Array = npt.NDArray[np.float64]

# file, d / initial height, aspect ratio (height / half width)
COLUMNS = (("01", 0.005 / 0.149, 0.5), ("04", 0.005 / 0.324, 1.42), ("03", 0.005 / 0.67, 6.26))
TALL = 10.0  # an aspect ratio beyond the bend of the scaling
FILM = 3  # grains
FREE_FALLS = 4.5  # duration in units of sqrt(2 H / g)


def scaling(aspect: float) -> float:
    return 2.2 * aspect if aspect < 7 else 3.9 * aspect**0.7


def collapse_of(aspect: float, grain: float) -> Collapse:
    """A column of half width 1 in a box that its run-out does not fill."""
    duration = FREE_FALLS * float(np.sqrt(2 * aspect)) + 2.0
    return Collapse(
        mu_s=0.32,
        mu_2=0.60,
        I0=0.4,
        d=grain * aspect,
        height=aspect,
        aspect=aspect,
        box_width=1.3 * (1 + scaling(aspect)),
        box_height=1.2 * aspect,
        cells=512 if aspect > 5 else 256,
        stride=1,
        frames=10,
        t_end=duration,
    )


def last_profile(path: Path, grain: float) -> tuple[Array, Array]:
    """|x| and h of the last profile, in units of the initial height."""
    block = [part for part in path.read_text().split("\n\n") if part.strip()][-1]
    x, h = np.array([line.split() for line in block.strip().splitlines()], float).T * grain
    return np.abs(x), h


def end(x: Array, height: Array, least: float) -> float:
    """The largest x at which the layer is thicker than `least`."""
    return float(x[height > least].max())


def measure(aspect: float, grain: float, discrete: tuple[Array, Array] | None) -> dict[str, Any]:
    """Lengths in units of the half width; heights of the initial height."""
    collapse = collapse_of(aspect, grain)
    flow = simulate(collapse)
    thickness = flow.c[-1].sum(axis=0) * (flow.y[1] - flow.y[0])
    moving = np.hypot(flow.u[-1], flow.v[-1])[flow.material[-1]]
    row: dict[str, Any] = {
        "aspect": aspect,
        "cells": collapse.cells,
        "runout": end(flow.x, thickness, collapse.d) - 1,
        "runout_above_film": end(flow.x, thickness, FILM * collapse.d) - 1,
        "runout_scaling": scaling(aspect),
        "largest_speed_at_end": float(moving.max()),
        "height_at_end": float(thickness[0] / aspect),
    }
    if discrete is not None:
        x, h = discrete
        own = np.interp(x, flow.x / aspect, thickness / aspect, right=0.0)
        row["runout_discrete"] = end(x, h, 0.0) * aspect - 1
        row["runout_discrete_above_film"] = end(x, h, FILM * grain) * aspect - 1
        row["profile_rms"] = float(np.sqrt(np.mean((own - h) ** 2)))
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("profiles", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for name, grain, aspect in COLUMNS:
        discrete = last_profile(options.profiles / f"ShapeTime.A-{name}.dat", grain)
        rows.append(measure(aspect, grain, discrete))
        print(json.dumps(rows[-1]), flush=True)
    rows.append(measure(TALL, COLUMNS[-1][1] * COLUMNS[-1][2] / TALL, None))
    print(json.dumps(rows[-1]), flush=True)
    raw.write(options.json, {"rows": rows})


if __name__ == "__main__":
    main()
