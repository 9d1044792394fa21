"""One GPU against several: identifications per second, and the steps of a batch that they share.

python -m bench.parallel --json gpu_parallel.json

Claim: two GPUs make at least 1.9 times as many steps of all members per second as one. Every
measurement is a torchrun of its own, which starts this module with --worker: with members, each
process trains its own part of an ensemble; without, all work on one batch, with an all-reduce in
every step.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch

from bench.gpu_step import gpu
from bench.gpu_training import Marks
from bench.processes import run_lines
from bench.studies import raw
from granpinn import identify, identify_many
from granpinn.config import Config
from granpinn.simulation import demo_path
from granpinn.training import parallel
from granpinn.training.parallel import choose_device

# Identifications of a process, and points of a shared batch; a CPU can only try the command.
WORKS = {"cuda": (24, (1024, 16384, 131072)), "cpu": (2, (64,))}
SECONDS = 300.0  # limit of one measurement


def worker(settings: dict[str, Any]) -> dict[str, Any]:
    """Do the work of one process of a group; its measurement."""
    changes, members = settings["changes"], settings["members"]
    config = Config(**{"simulated_pressure__frames": 0} | changes)
    marks = Marks()
    if members:
        seeds = list(range(members))
        results = identify_many([demo_path()] * members, config, seeds, progress=marks)
    else:
        results = [identify(demo_path(), config, progress=marks)]
    found: dict[str, Any] = {"training_s": max(result.timing.wall_s for result in results)}
    if marks.marks:  # of the first process
        found["steps_per_s"] = marks.rate(config)
    return found | {"failures": sum(result.failure is not None for result in results)}


def measure(processes: int, settings: dict[str, Any]) -> dict[str, Any]:
    """The measurement of a group of processes, or the error."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
        command += ["--nproc-per-node", str(processes), "-m", "bench.parallel"]
        command += ["--worker", json.dumps(settings), "--json", str(answer)]
        _, reason = run_lines(command, None, SECONDS)
        if not answer.exists():
            return {"error": reason or "the processes left no answer"}
        found: dict[str, Any] = json.loads(answer.read_text())
        return found


def works(device: str, count: int) -> Iterator[tuple[str, int, dict[str, Any]]]:
    """Name, members and settings of every measurement with so many processes."""
    members, sizes = WORKS[device]
    yield f"{members} members a process", members * count, {}
    for points in sizes:
        batch = {"batch__interior": points, "batch__surface": max(points // 8, count)}
        yield f"a batch of {points}", 0, batch


def with_gain(row: dict[str, Any], rows: list[dict[str, Any]]) -> dict[str, Any]:
    """A row with its rate over that of one process: steps per second of all its members."""
    same = [r for r in [*rows, row] if r["work"] == row["work"] and "steps_per_s" in r]
    one = next((r for r in same if r["processes"] == 1), None)
    if one is None or "steps_per_s" not in row:
        return row
    more = row["processes"] if row["members"] else 1
    return row | {"times_one": more * row["steps_per_s"] / one["steps_per_s"]}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--steps", type=int, default=8000, help="steps of each measurement")
    parser.add_argument("--json", type=Path, help="file for the raw results")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    own = parser.parse_args()
    if own.worker:
        with parallel.joined() as rank:
            found = worker(json.loads(own.worker))
            if rank == 0:
                own.json.write_text(json.dumps(found))
        return 0
    device = choose_device(own.device)
    available = torch.cuda.device_count() if device.type == "cuda" else 2
    common = {"device": device.type, "steps": own.steps, "log_every": own.steps // 80}
    common |= {} if device.type == "cuda" else {"network__widths": (8, 8)}
    rows: list[dict[str, Any]] = []
    for count in range(1, min(available, 2) + 1):
        for work, members, changes in works(device.type, count):
            settings = {"members": members, "changes": common | changes}
            row = {"work": work, "processes": count, "members": members}
            rows.append(with_gain(row | measure(count, settings), rows))
            print(json.dumps(rows[-1]), flush=True)
    raw.write(own.json, {"gpus": gpu(device) | {"count": available}, "rows": rows})
    return int(any("error" in row for row in rows))


if __name__ == "__main__":
    sys.exit(main())
