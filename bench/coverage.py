"""Coverage study of the error bars: known materials, drawn at random, simulated and identified.

python -m bench.coverage --truths 100 --members 2 --controls 4 --json coverage.json
python -m bench.coverage_fit coverage.json --write granpinn/uncertainty/calibration.json

The first command draws mu_s in 0.2 to 0.6 and mu_2 - mu_s in 0.1 to 0.3, simulates each collapse
(one core each, all cores), identifies all of them as one batch and writes values and residuals of
every member; the second one makes the calibration table of it and says what it covers.
Settings that are not its own go to the identification as they are (`--steps 20000 --noise 0.2`).

Controls are flows that do not obey mu(I): a fluid of constant viscosity, cohesive grains, and
collapses played backwards. A verdict has to flag them.
Defends: the 90 % intervals of the default recipe hold 85 to 95 % of the truths.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.machine import describe
from granpinn import identify_many
from granpinn.config import Config, ConfigError, kinds_of, recipes
from granpinn.config.toml import convert
from granpinn.data import Flow, read_flow
from granpinn.results import Result
from granpinn.results.decoding import encode
from granpinn.simulation import Collapse, simulate
from granpinn.training.progress import Lines

MU_S, SLOPE = (0.2, 0.6), (0.1, 0.3)  # slope: mu_2 - mu_s
VISCOSITY = (0.3, 3.0)  # of the viscous control, log-uniform; 10 sqrt(10) is the unit of the column
COHESION = (0.5, 2.0)  # of the cohesive control; the weight of the column is 10
LAW = "mu(I)"


@dataclasses.dataclass(frozen=True)
class Task:
    """One flow to be made: its law ("mu(I)" or the kind of control) and the collapse."""

    name: str
    law: str
    collapse: Collapse


def draw(truths: int, controls: int, seed: int, **settings: Any) -> list[Task]:
    """The collapses of a study, a function of the arguments; the first truths of two studies of
    one seed are the same.
    """
    generator = np.random.default_rng(seed)

    def material() -> dict[str, Any]:
        mu_s, slope = (float(generator.uniform(*limits)) for limits in (MU_S, SLOPE))
        return {"mu_s": mu_s, "mu_2": mu_s + slope}

    tasks = [
        Task(f"law-{seed}-{i:04d}", LAW, Collapse(**material(), **settings)) for i in range(truths)
    ]
    generator = np.random.default_rng((seed, 1))
    for i in range(controls):
        eta = float(np.exp(generator.uniform(*np.log(VISCOSITY))))
        changes: dict[str, dict[str, Any]] = {
            "viscous": {"eta_min": eta * (1 - 1e-6), "eta_max": eta},
            "cohesive": {"cohesion": float(generator.uniform(*COHESION))},
            "reversed": {},
        }
        tasks += [
            Task(f"{law}-{seed}-{i:04d}", law, Collapse(**material() | change, **settings))
            for law, change in changes.items()
        ]
    return tasks


def make(task: Task, folder: Path) -> Path:
    """Simulate a task unless an earlier study has left its file."""
    path = folder / f"{task.name}-{task.collapse.cells}-{task.collapse.frames}.h5"
    if not path.exists():
        simulate(task.collapse, out=path)
    return path


def read(task: Task, path: Path) -> Flow:
    """The flow as an experiment would give it: without the limits of the viscosity."""
    flow = read_flow(path)
    flow = dataclasses.replace(flow, eta_min=None, eta_max=None, p=None)
    return backwards(flow) if task.law == "reversed" else flow


def backwards(flow: Flow) -> Flow:
    """The film played backwards: friction then drives the grains."""
    end, surface = flow.t[-1] + flow.t[0], flow.surface
    assert surface is not None
    return dataclasses.replace(
        flow,
        u=-flow.u[::-1],
        v=-flow.v[::-1],
        c=flow.c[::-1],
        surface=dataclasses.replace(surface, t=end - surface.t),
    )


def row(task: Task, result: Result) -> dict[str, Any]:
    """What coverage_fit needs to know about one identification."""
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
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=context) as pool:
        paths = list(pool.map(make, tasks, [folder] * len(tasks)))
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


def settings_of(words: Sequence[str]) -> dict[str, Any]:
    """`--steps 200 --network.widths 64,64` as settings of the identification."""
    kinds = kinds_of(Config)
    values = {}
    padded = [*words, ""][: len(words) + len(words) % 2]
    for flag, text in zip(padded[::2], padded[1::2], strict=True):
        key = flag.removeprefix("--")
        key = key if key in kinds else key.replace("-", "_")
        if key not in kinds or not text:
            raise ConfigError(f"{flag} must be a setting of granpinn.train and have a value")
        values[key] = convert(text, kinds[key], flag)
    return values


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
        usual = {"simulated_pressure.frames": 0}
        config = recipes.build(usual | settings_of(words) | {"members": own.members})
    except ConfigError as error:
        parser.error(str(error))
    grid = {"cells": own.cells, "stride": own.stride, "frames": own.frames, "threads": 1}
    tasks = draw(own.truths, own.controls, own.draw, **grid)
    with tempfile.TemporaryDirectory() as temporary:
        folder = own.flows or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        found = study(tasks, config, folder, own.at_once)
    head = {
        "date": time.strftime("%Y-%m-%d"),
        "machine": describe(),
        "draw": own.draw,
        "simulation": grid,
        "members": own.members,
        "settings": words,
        "steps": config.steps,
    }
    own.json.write_text(json.dumps(head | found, indent=1, allow_nan=False) + "\n")
    from bench import coverage_fit

    print(coverage_fit.summary(found["rows"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
