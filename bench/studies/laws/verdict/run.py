"""Verdict power: planted violations of the law, and clean flows for false alarms.

    python -m bench.studies.laws.verdict.run --clean 60 --violations 10 --noise 0 0.02 0.05 \\
        --device auto --flows FLOWS --json verdict.json

Simulates every flow (one core each, all cores), identifies all flows and noises as batches of
`--at-once`, and compares the verdicts with what was planted. Settings that are not its own go to
the identification (`--steps 10000 --network.widths 64,64,64`). A second run with the same `--flows`
keeps the flow files. `--kinds clean time` makes some kinds only.

Defends: at least 90 % of the violations are found and their part is named at 2 % noise, and at most
5 % of the clean flows are called a violation.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

from bench.studies import raw
from bench.studies.cores import on_all_cores
from bench.studies.laws.verdict.flows import CLEAN, KINDS, make
from bench.studies.laws.verdict.table import named, table
from granpinn import identify_many
from granpinn.config import Config, ConfigError
from granpinn.data import FlowFileError, FlowFileWarning, read_flow
from granpinn.identification.case import pose
from granpinn.results import Result
from granpinn.results.decoding import encode
from granpinn.results.parts import Split
from granpinn.training.progress import Lines


class Task(NamedTuple):
    """One flow."""

    kind: str
    number: int
    cells: int
    stride: int
    frames: int


def made(task: Task, folder: Path) -> Path:
    """The file of a task."""
    return make(task.kind, task.number, folder, task.cells, task.stride, task.frames)


def halves(split: Split) -> dict[str, Any]:
    """The record of a split, and the part of the residuals in its standard deviation."""
    found: dict[str, Any] = encode(split)
    if split.percent is not None:
        square = (split.std_percent or 0.0) ** 2 - (split.model_percent or 0.0) ** 2
        found["residual_percent"] = max(square, 0.0) ** 0.5
    return found


def row(task: Task, noise: float, result: Result) -> dict[str, Any]:
    """What the table needs of one identification, and what a later one may ask."""
    values = {name: p.value for name, p in result.parameters.items()}
    return {
        "kind": task.kind,
        "number": task.number,
        "noise": noise,
        "truth": {name: getattr(result.truth, name, None) for name in values},
        "values": values,
        "velocity_percent": result.error_percent.velocity,
        "verdict": None if result.verdict is None else encode(result.verdict),
        "parts": None if result.parts is None else [halves(s) for s in result.parts.splits],
        "failure": result.failure,
        "named": named(task.kind, result),
    }


def refusal(path: Path, config: Config) -> str | None:
    """Why granpinn refuses a flow before any training; None: it does not."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FlowFileWarning)
            pose(path, config)
    except FlowFileError as error:
        return str(error)
    return None


def study(
    tasks: Sequence[Task], noises: Sequence[float], config: Config, folder: Path, at_once: int
) -> Iterator[dict[str, Any]]:
    """Make and identify all flows; after each batch all rows, and the seconds of each part."""
    begin = time.monotonic()
    paths = on_all_cores(made, tasks, repeat(folder, len(tasks)))
    simulated = time.monotonic()
    print(f"{len(tasks)} flows in {simulated - begin:.0f} s", flush=True)
    refused = {path: why for path in paths if (why := refusal(path, config)) is not None}
    kept = [(t, p) for t, p in zip(tasks, paths, strict=True) if p not in refused]
    members = [(task, path, noise) for noise in noises for task, path in kept]
    rows: list[dict[str, Any]] = []
    for first in range(0, len(members), at_once):
        part = members[first : first + at_once]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FlowFileWarning)
            flows = [read_flow(path) for _, path, _ in part]
            seeds = [config.seed + first + k for k in range(len(part))]
            noise = [value for *_, value in part]
            results = identify_many(flows, config, seeds, noise=noise, progress=Lines())
        rows += [row(task, sd, r) for (task, _, sd), r in zip(part, results, strict=True)]
        seconds = {"simulate_s": simulated - begin, "identify_s": time.monotonic() - simulated}
        yield {
            "seconds": {name: round(value, 1) for name, value in seconds.items()},
            "refused": {path.name: why for path, why in refused.items()},
            "rows": rows,
        }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--clean", type=int, default=60, help="flows of one law")
    parser.add_argument("--violations", type=int, default=10, help="flows of each violation")
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--noise", nargs="+", type=float, default=[0.0, 0.02, 0.05])
    parser.add_argument("--cells", type=int, default=128, help="cells across the simulated box")
    parser.add_argument("--stride", type=int, default=1, help="cells between the vectors")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="number of the first flow of a kind")
    parser.add_argument("--at-once", type=int, default=10**6, help="flows in one batch")
    parser.add_argument("--flows", type=Path, help="folder that keeps the flow files")
    parser.add_argument("--json", type=Path, required=True, help="file for the results")
    own, words = parser.parse_known_args()
    try:
        config = raw.config_of(words)
    except ConfigError as error:
        parser.error(str(error))
    tasks = [
        Task(kind, own.first + k, own.cells, own.stride, own.frames)
        for kind in own.kinds
        for k in range(own.clean if kind == CLEAN else own.violations)
    ]
    head = {"cells": own.cells, "stride": own.stride, "frames": own.frames, "settings": words}
    head |= {"steps": config.steps}
    with tempfile.TemporaryDirectory() as temporary:
        folder = own.flows or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for found in study(tasks, own.noise, config, folder, own.at_once):
            raw.write(own.json, head | found)
            print(table(found["rows"]), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
