"""Gate T-2: kill -9 at random moments, resume, and end in the same bits as an undisturbed run.

    python -m bench.studies.reliability.kills --kills 100 --seed 0

A chain begins a run, kills it at a random moment, resumes it, kills it again, until it ends by
itself. After every kill the newest checkpoint must load, no step that it had before may be lost,
and it may be at most one interval older than the last row of the history. The end of a chain must
have the bits of a run without kills. One kill in five falls between the start of the process and
the first checkpoint, where libraries are loaded and folders are made.
"""

from __future__ import annotations

import argparse
import os
import signal
import tempfile
import time
from pathlib import Path
from random import Random
from subprocess import Popen
from typing import NamedTuple

from bench.studies.reliability import runs
from bench.studies.reliability.record import RESULTS, Record, recorded
from granpinn.training import checkpoint
from granpinn.training.checkpoint import CheckpointError

INTERVAL = 0.3  # seconds between checkpoints
SLACK = 1.0  # seconds for the rows of a step and for a checkpoint on a busy machine
MOST_FAILURES = 10  # that a mode goes on after
EARLY = 0.2  # share of the kills before the first checkpoint of a process
FLAGS = ["--network.widths", "16,16", "--batch.interior", "64", "--batch.surface", "16"]
FLAGS += ["--log-every", "20", "--checkpoint-every", str(INTERVAL)]
FLAGS += ["--simulated_pressure.frames", "4"]


class Mode(NamedTuple):
    """A kind of run: flags, number of processes."""

    flags: tuple[str, ...]
    processes: int = 1


MODES = {
    "single": Mode(("--steps", "4000")),
    "members": Mode(("--steps", "1500", "--members", "3")),
    "torchrun": Mode(("--steps", "2500"), processes=2),
}


class Undisturbed(NamedTuple):
    """A run without kills: its folder, seconds to its first checkpoint, and seconds after that."""

    folder: Path
    before: float
    after: float


def main() -> int:
    """Run the gate; 1 if a kill or a chain failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    options = parser.parse_args()
    out = RESULTS / f"kills-{options.device}.json"
    module = "bench.studies.reliability.kills"
    with recorded("T-2", module, out) as record, tempfile.TemporaryDirectory() as folder:
        flow = runs.make_flow(Path(folder) / "flow.h5")
        for k, name in enumerate(MODES):
            count = len(range(k, options.kills, len(MODES)))
            kill(name, count, options.seed, options.device, flow, record)
    return int(bool(record.failures))


def kill(name: str, count: int, seed: int, device: str, flow: Path, record: Record) -> None:
    """`count` kills of runs of one mode."""
    mode, place = MODES[name], flow.parent / name
    flags = [*mode.flags, *FLAGS, "--device", device]
    whole = undisturbed(flow, place / "whole", flags, mode.processes)
    draw = Random(f"{seed} {name}")
    kills, chains = 0, 0
    while kills < count or chains == 0:
        out = place / str(chains)
        argv, newest = runs.command(flow, out, flags, mode.processes), 0
        while True:
            asked = kills < count
            ended, moment = one(argv, out, whole, draw, mode.processes) if asked else last(argv)
            if ended:
                break
            kills += 1
            reason, newest = survived(out, newest)
            outcome = "checkpoint whole" if newest else "no checkpoint yet"
            failure = {"mode": name, "seed": seed, "chain": chains, "kill": kills, "moment": moment}
            record.add(reason or outcome, failure | {"reason": reason} if reason else None)
        differs = ended if ended != "0" else runs.difference(whole.folder, out)
        chains += 1
        if differs:
            failure = {"mode": name, "seed": seed, "chain": chains, "reason": differs}
            record.failures.append(failure)
            if len(record.failures) > MOST_FAILURES:
                return
        print(f"{name}: {kills} kills, chain {chains}: {differs or 'same bits'}", flush=True)
    record.details[name] = {"kills": kills, "chains with the same bits": chains}


def undisturbed(flow: Path, out: Path, flags: list[str], processes: int) -> Undisturbed:
    """A run without kills."""
    begin = time.monotonic()
    process = runs.start(runs.command(flow, out, flags, processes))
    while process.poll() is None and not list(out.glob("checkpoint/step-*.json")):
        time.sleep(0.02)
    before = runs.seconds_since(begin)
    _, err = process.communicate()
    if process.returncode:
        raise SystemExit(f"the run without kills failed: {err.splitlines()[-1:]}")
    return Undisturbed(out, before, runs.seconds_since(begin) - before)


def one(
    argv: list[str], out: Path, whole: Undisturbed, draw: Random, processes: int
) -> tuple[str, float]:
    """One process that is killed, unless it ends before: how it ended ("" if killed), when."""
    early = draw.random() < EARLY
    moment = draw.uniform(0, whole.before if early else 0.6 * whole.after)
    alone = processes > 1 and draw.random() < 0.5
    process = runs.start(argv)
    if not early and not runs.wait_until(process, 0.8 * whole.before):
        pass  # most of the libraries are loaded
    if runs.wait_until(process, moment):
        return conclude(process), moment
    workers = runs.children(process.pid) if processes > 1 else []
    if alone and workers:  # torchrun ends the other worker
        os.kill(draw.choice(workers), signal.SIGKILL)
        runs.wait_until(process, 60)
    runs.end(process)
    process.communicate()
    return "", round(moment, 3)


def last(argv: list[str]) -> tuple[str, float]:
    """A process that ends by itself."""
    process = runs.start(argv)
    process.wait(600)
    return conclude(process), 0.0


def conclude(process: Popen[str]) -> str:
    """The text 0 for a run that ended well; else its exit code and its last words."""
    _, err = process.communicate()
    return "0" if process.returncode == 0 else f"exit {process.returncode}: {err[-300:]}"


def survived(out: Path, before: int) -> tuple[str, int]:
    """What is wrong after a kill ("" for nothing), and the step of the newest checkpoint."""
    try:
        found = checkpoint.newest(out / "checkpoint")
    except CheckpointError as error:
        return str(error), before
    if found is None:
        return ("the checkpoints are gone" if before else ""), before
    step = found.state.training.step
    if step < before:
        return f"step {step} is before step {before}", step
    lost = runs.training_time(out) - found.state.wall_s
    if lost > INTERVAL + SLACK:
        return f"{lost:.2f} s of training are lost", step
    return "", step


if __name__ == "__main__":
    raise SystemExit(main())
