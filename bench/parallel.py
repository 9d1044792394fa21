"""One GPU against several: identifications per hour, and the steps of a batch that they share.

python -m bench.parallel --json bench/results/gpu_parallel.json

Claim: two GPUs make at least 1.9 times as many identifications per hour as one. Every measurement
is a torchrun of its own, which starts this module with --worker. `spread` gives each process its
own members of an ensemble; `share` lets all work on one batch, with an all-reduce in every step.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import torch

from bench.gpu_step import gpu, rounded
from bench.gpu_training import Marks
from bench.machine import describe
from bench.processes import run_lines
from granpinn import identify, identify_many
from granpinn.config import Config
from granpinn.fit.case import choose_device
from granpinn.simulation import demo_path
from granpinn.training import parallel

GOAL = 1.9
WHOLE_RUN = Config().steps or 0  # steps of the default recipe


def worker(settings: dict[str, Any]) -> dict[str, Any]:
    """Do the work of one process of a group; its measurement."""
    changes, members = settings["changes"], settings["members"]
    config = Config(**{"simulated_pressure__frames": 0} | changes)
    marks = Marks()
    begin = time.monotonic()
    if members:
        seeds = list(range(members))
        results = identify_many([demo_path()] * members, config, seeds, progress=marks)
        training_s = max(result.timing.wall_s for result in results)
        failures = sum(result.failure is not None for result in results)
    else:
        result = identify(demo_path(), config, progress=marks)
        training_s, failures = result.timing.wall_s, 0
    found: dict[str, Any] = {"seconds": time.monotonic() - begin, "training_s": training_s}
    if marks.marks:  # of the first process
        found["steps_per_s"] = marks.rate(config)
    return found | {"failures": failures}


def measure(processes: int, settings: dict[str, Any], seconds: float) -> dict[str, Any]:
    """The measurement of a group of processes, or the error."""
    row = {"processes": processes, "members": settings["members"]}
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
        command += ["--nproc-per-node", str(processes), "-m", "bench.parallel"]
        command += ["--worker", json.dumps(settings), "--json", str(answer)]
        _, reason = run_lines(command, None, seconds)
        if not answer.exists():
            return row | {"error": reason or "the processes left no answer"}
        found: dict[str, Any] = json.loads(answer.read_text())
        return row | found


def per_hour(row: dict[str, Any], steps: int) -> dict[str, float]:
    """Identifications per hour: as measured, and with the number of steps of the default recipe.

    The latter adds the missing steps at the measured rate.
    """
    whole = row["seconds"] + (WHOLE_RUN - steps) / row["steps_per_s"]
    return {
        "per_hour_measured": 3600 * row["members"] / row["seconds"],
        "per_hour": 3600 * row["members"] / whole,
    }


def compare(rows: list[dict[str, Any]], rate: str) -> None:
    """Adds to every row its rate relative to the first one of the same work on one process."""
    for row in rows:
        one = [r for r in rows if r["processes"] == 1 and rate in r and r["work"] == row["work"]]
        if one and rate in row:
            row["times_one"] = row[rate] / one[0][rate]


def text(spread: list[dict[str, Any]], share: list[dict[str, Any]]) -> str:
    lines = []
    for row in spread + share:
        line = f"{row['processes']} processes, {row['work']:<34}"
        if "error" in row:
            lines.append(line + row["error"])
            continue
        if "per_hour" in row:
            line += f"{row['per_hour']:8.0f} identifications/h"
        else:
            line += f"{1e3 / row['steps_per_s']:8.3f} ms per step     "
        lines.append(line + (f"  {row['times_one']:.2f}x one" if "times_one" in row else ""))
    return "\n".join(lines) + f"\ngoal: two processes >= {GOAL}x one, in identifications per hour"


def study(arguments: argparse.Namespace) -> dict[str, Any]:
    device = choose_device(arguments.device)
    available = torch.cuda.device_count() if device.type == "cuda" else 2
    counts = [count for count in arguments.processes if count <= available]
    common = {"device": device.type, "steps": arguments.steps, "log_every": arguments.log_every}
    if arguments.widths:
        common["network__widths"] = arguments.widths
    spread, share = [], []
    for work, each in (("members in all", 0), ("members per process", 1)):
        for count in counts:
            if each and count == 1:
                continue  # the same as above
            members = arguments.members * (count if each else 1)
            settings = {"members": members, "changes": common}
            row = {"work": f"{arguments.members} {work}"} | measure(
                count, settings, arguments.seconds
            )
            if "error" not in row:
                row |= per_hour(row, arguments.steps)
            spread.append(row)
            print(json.dumps(rounded(row)), flush=True)
    first = next((row for row in spread if "per_hour" in row and row["processes"] == 1), None)
    for row in spread:
        if first and "per_hour" in row:
            row["times_one"] = row["per_hour"] / first["per_hour"]
    for points in arguments.points:
        for count in counts:
            batch = {"batch__interior": points, "batch__surface": max(points // 8, count)}
            settings = {"members": 0, "changes": common | batch}
            row = {"work": f"a batch of {points}"} | measure(count, settings, arguments.seconds)
            share.append(row)
            print(json.dumps(rounded(row)), flush=True)
    compare(share, "steps_per_s")
    return {
        "date": time.strftime("%Y-%m-%d"),
        "machine": describe() | gpu(device) | {"gpus": available},
        "steps": arguments.steps,
        "spread": spread,
        "share": share,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--members", type=int, default=24, help="identifications at a time")
    parser.add_argument("--steps", type=int, default=8000, help="steps of each measurement")
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 16384, 131072])
    parser.add_argument("--log-every", type=int, default=100)
    parser.add_argument("--widths", type=int, nargs="+", help="hidden layers, to try it on a CPU")
    parser.add_argument("--seconds", type=float, default=300.0, help="limit of one measurement")
    parser.add_argument("--json", type=Path, help="file for the raw results")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.worker:
        with parallel.joined() as rank:
            found = worker(json.loads(arguments.worker))
            if rank == 0:
                arguments.json.write_text(json.dumps(found))
        return 0
    result = study(arguments)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(rounded(result), indent=1) + "\n")
    print(text(result["spread"], result["share"]))
    return any("error" in row for row in result["spread"] + result["share"])


if __name__ == "__main__":
    sys.exit(main())
