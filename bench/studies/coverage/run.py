"""Coverage study of the error bars: known materials, drawn at random, simulated and identified.

python -m bench.studies.coverage.run --truths 100 --members 2 --controls 4 --json coverage.json
python -m bench.studies.coverage.calibrate coverage.json --write

The first command draws mu_s in 0.2 to 0.6 and mu_2 - mu_s in 0.1 to 0.3, simulates each collapse
(one core each, all cores), identifies all of them as one batch and writes values and residuals of
every member. It also prints what the shipped calibration says of them. The second one makes the
shipped calibration from them. Settings that are not its own go to the identification as they are
(`--steps 20000 --noise 0.2`).

Controls are flows that do not obey mu(I). A verdict has to flag them.
Defends: the 90 % intervals of the default recipe hold 85 to 95 % of the truths.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import repeat
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.cores import on_all_cores
from bench.studies.coverage.judge import cases_of, report
from bench.studies.coverage.materials import Task, draw, make, read
from granpinn import identify_many
from granpinn.config import Config, ConfigError
from granpinn.results import Result
from granpinn.results.decoding import encode
from granpinn.training.progress import Lines
from granpinn.uncertainty import calibration


def row(task: Task, result: Result) -> dict[str, Any]:
    """What judge.py needs of one identification."""
    c, residuals = task.collapse, result.residuals
    assert result.members is not None
    return {
        "name": task.name,
        "law": task.law,
        "truth": {"mu_s": c.mu_s, "mu_2": c.mu_2},
        "members": encode(result.members),
        "residuals": residuals,
        "velocity_error_percent": result.error_percent.velocity,
        "steps": result.timing.steps,
        "n_points": result.data.n_points,
        "failure": result.failure or (None if residuals else "residuals that are not finite"),
    }


def study(tasks: Sequence[Task], config: Config, folder: Path, at_once: int) -> dict[str, Any]:
    """Simulate and identify all tasks; rows, and the seconds that each part took."""
    begin = time.monotonic()
    paths = on_all_cores(make, tasks, repeat(folder, len(tasks)))
    simulated = time.monotonic()
    print(f"{len(tasks)} flows in {simulated - begin:.0f} s", flush=True)
    rows = []
    for start in range(0, len(tasks), at_once):
        part = range(start, min(start + at_once, len(tasks)))
        flows = [read(tasks[i], paths[i]) for i in part]
        results = identify_many(flows, config, [config.seed + i for i in part], progress=Lines())
        rows += [row(tasks[i], result) for i, result in zip(part, results, strict=True)]
    seconds = {"simulate_s": simulated - begin, "identify_s": time.monotonic() - simulated}
    return {"seconds": {k: round(v, 1) for k, v in seconds.items()}, "rows": rows}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--truths", type=int, default=100, help="number of materials")
    parser.add_argument("--controls", type=int, default=4, help="flows of each of the other laws")
    parser.add_argument("--members", type=int, default=2, help="networks for each flow")
    parser.add_argument("--cells", type=int, default=256, help="cells across the simulated box")
    parser.add_argument("--stride", type=int, default=2, help="cells between the vectors")
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--draw", type=int, default=0, help="seed of the materials")
    parser.add_argument("--at-once", type=int, default=10**6, help="flows in one batch")
    parser.add_argument("--flows", type=Path, help="folder that keeps the flow files")
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    own, words = parser.parse_known_args()
    try:
        config = raw.config_of(words, {"members": own.members})
    except ConfigError as error:
        parser.error(str(error))
    grid = {"cells": own.cells, "stride": own.stride, "frames": own.frames, "threads": 1}
    tasks = draw(own.truths, own.controls, own.draw, **grid)
    with tempfile.TemporaryDirectory() as temporary:
        folder = own.flows or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        found = study(tasks, config, folder, own.at_once)
    head = {
        "draw": own.draw,
        "simulation": grid,
        "members": own.members,
        "settings": words,
        "steps": config.steps,
    }
    raw.write(own.json, head | found)
    table = calibration.load()
    print(report([(case, table) for case in cases_of(found["rows"])]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
