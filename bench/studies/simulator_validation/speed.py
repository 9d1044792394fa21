"""Seconds of a collapse against its resolution.

python -m bench.studies.simulator_validation.speed --json speed.json

Defends: the paper's column at 512 cells to t = 5 in 120 s on two cores; a cost per cell and step
within a factor of 1.5 from 128 to 1024 cells; iteration counts that do not grow with the grid.
CPU seconds are those of all threads, which a busy machine does not lengthen.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies import raw
from granpinn.simulation import Collapse, Engine


def measure(cells: int, threads: int) -> dict[str, Any]:
    """The paper's column, mu_s = 0.4 and mu_2 = 0.64, with steps that end on 200 frames."""
    engine = Engine(Collapse(cells=cells, threads=threads))
    begin, cpu_begin = time.perf_counter(), time.process_time()
    reports = []
    for frame in range(1, 201):
        while 0.025 * frame - engine.time > 1e-9:
            reports.append(engine.step(0.025 * frame - engine.time))
    wall, cpu = time.perf_counter() - begin, time.process_time() - cpu_begin
    computed = sum(r.window[0] * r.window[1] for r in reports)
    return {
        "cells": cells,
        "threads": threads,
        "steps": len(reports),
        "wall_s": round(wall, 2),
        "cpu_s": round(cpu, 2),
        "cells_per_step": round(computed / len(reports)),
        "cpu_us_per_cell_and_step": round(cpu / computed * 1e6, 3),
        "viscous_iterations": round(float(np.mean([r.viscous_iterations for r in reports])), 2),
        "pressure_iterations": round(float(np.mean([r.pressure_iterations for r in reports])), 2),
        "most_iterations": max(max(r.viscous_iterations, r.pressure_iterations) for r in reports),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cells", type=int, nargs="+", default=[128, 256, 512, 1024])
    parser.add_argument("--threads", type=int, nargs="+", default=[1])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for threads in options.threads:
        for cells in options.cells:
            rows.append(measure(cells, threads))
            print(json.dumps(rows[-1]), flush=True)
    raw.write(options.json, {"rows": rows})


if __name__ == "__main__":
    main()
