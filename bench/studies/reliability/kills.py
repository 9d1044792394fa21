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
import tempfile
import time
from pathlib import Path
from random import Random

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


# Flags of every kind of run.
MODES = {"single": ("--steps", "4000"), "members": ("--steps", "1500", "--members", "3")}


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
    place = flow.parent / name
    flags, whole = [*MODES[name], *FLAGS, "--device", device], place / "whole"
    before, after = undisturbed(runs.command(flow, whole, flags), whole)
    draw = Random(f"{seed} {name}")
    kills, chains = 0, 0
    while kills < count or chains == 0:
        out, newest = place / str(chains), 0
        argv = runs.command(flow, out, flags)
        while True:
            process = runs.start(argv)
            early = draw.random() < EARLY
            first, last = (0.0, before) if early else (0.8 * before, 0.8 * before + 0.6 * after)
            moment = round(draw.uniform(first, last), 3)
            if runs.wait_until(process, 600 if kills == count else moment):
                _, err = process.communicate()
                ended = f"exit {process.returncode}: {err[-300:]}"
                break
            runs.end(process)
            process.communicate()
            kills += 1
            reason, newest = survived(out, newest)
            outcome = "checkpoint whole" if newest else "no checkpoint yet"
            failure = {"mode": name, "seed": seed, "chain": chains, "kill": kills, "moment": moment}
            record.add(reason or outcome, failure | {"reason": reason} if reason else None)
        differs = runs.difference(whole, out) if ended.startswith("exit 0") else ended
        chains += 1
        if differs:
            failure = {"mode": name, "seed": seed, "chain": chains, "reason": differs}
            record.failures.append(failure)
            if len(record.failures) > MOST_FAILURES:
                return
        print(f"{name}: {kills} kills, chain {chains}: {differs or 'same bits'}", flush=True)
    record.details[name] = {"kills": kills, "chains with the same bits": chains}


def undisturbed(argv: list[str], out: Path) -> tuple[float, float]:
    """Seconds of a run without kills to its first checkpoint, and after that."""
    begin = time.monotonic()
    process = runs.start(argv)
    while process.poll() is None and not list(out.glob("checkpoint/step-*.safetensors")):
        time.sleep(0.02)
    first = time.monotonic()
    _, err = process.communicate()
    if process.returncode:
        raise SystemExit(f"the run without kills failed: {err.splitlines()[-1:]}")
    return first - begin, time.monotonic() - first


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
