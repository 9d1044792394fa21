"""Gate T-4: SIGINT and SIGTERM at every phase of a training; a second signal ends it at once.

    python -m bench.studies.reliability.signals --repeats 3

A process announces the phase that it has reached, waits a moment in it, and receives a signal. It
must end within 10 s with 130 or 143, one sentence and no traceback; if it has trained, its newest
checkpoint must load. For the second signal, the process takes a minute to save or to clean up after
the first one: the second must end it within a second.
"""

from __future__ import annotations

import argparse
import functools
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

from bench.studies.reliability import runs
from bench.studies.reliability.record import RESULTS, recorded
from granpinn.data import read_flow, write_flow
from granpinn.training import checkpoint

PHASES = (
    *("imports", "pre-fit", "training", "last layer", "copies", "simulated pressure"),
    *("resimulation", "figures"),
)
SIGNALS = (signal.SIGINT, signal.SIGTERM)
FIRST, SECOND = 10.0, 1.0  # seconds to end
STAY = 0.5  # seconds that a phase lasts at least
MINUTE = 60.0
FLAGS = ["--network.widths", "16,16", "--batch.interior", "64", "--batch.surface", "16"]
FLAGS += ["--steps", "400", "--log-every", "20", "--simulated_pressure.frames", "4"]
FLAGS += ["--resimulate", "--resimulation.cells", "64"]


def main() -> int:
    """Run the gate; 1 if a signal ended as it must not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--phases", nargs="+", choices=PHASES, default=list(PHASES))
    parser.add_argument("--out", type=Path, default=RESULTS / "signals.json")
    options = parser.parse_args()
    draw = Random(options.seed)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a job in the background
    slowest = dict.fromkeys(("first", "second"), 0.0)
    module = "bench.studies.reliability.signals"
    with recorded("T-4", module, options.out) as record, tempfile.TemporaryDirectory() as folder:
        record.details["slowest, in seconds"] = slowest
        flow = make_flow(Path(folder))
        for k in range(options.repeats):
            for phase in options.phases:
                for number in SIGNALS:
                    for which in slowest if phase != "imports" else ("first",):
                        out = Path(folder) / f"{k} {phase} {number} {which}"
                        moment = draw.uniform(0, 2.5) if phase == "imports" else None
                        seconds, reason = one(flow, out, phase, number, which == "second", moment)
                        slowest[which] = max(slowest[which], seconds)
                        case = {"phase": phase, "signal": number.name, "which": which}
                        case |= {"moment": moment, "reason": reason}
                        outcome = f"{which} signal: {reason or 'ended well'}"
                        record.add(outcome, case if reason else None)
                        print(case, f"{seconds:.2f} s", flush=True)
    return int(bool(record.failures))


def make_flow(folder: Path) -> Path:
    """A small simulated collapse with an uncertain surface line, whose training has copies."""
    exact = read_flow(runs.make_flow(folder / "exact.h5"))
    path = folder / "flow.h5"
    write_flow(replace(exact, attributes={**exact.attributes, "surface_sd": 0.01}), path)
    return path


def one(
    flow: Path, out: Path, phase: str, number: signal.Signals, twice: bool, moment: float | None
) -> tuple[float, str]:
    """Seconds from the signal to the end, and what is wrong with it ("" for nothing)."""
    train = [str(flow), "--out", str(out), *FLAGS]
    module = "granpinn.train" if phase == "imports" else "bench.studies.reliability.signals"
    child = [] if phase == "imports" else ["--child", phase, *(["--slow"] if twice else []), "--"]
    process = subprocess.Popen(
        [sys.executable, "-m", module, *child, *train],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    if moment is not None:
        time.sleep(moment)
    else:
        heard(process, f"reached {phase}")
    sent = time.monotonic()
    process.send_signal(number)
    if twice:
        heard(process, "cleaning up")
        sent = time.monotonic()
        process.send_signal(number)
    try:
        _, err = process.communicate(timeout=MINUTE / 2)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return MINUTE / 2, "goes on"
    seconds = time.monotonic() - sent
    return seconds, wrong(process.returncode, number, seconds, err, out, twice, phase)


def wrong(
    code: int, number: int, seconds: float, err: str, out: Path, twice: bool, phase: str
) -> str:
    """What is wrong with the end of a process; "" for nothing."""
    if code != 128 + number:
        return f"exit code {code}"
    if seconds > (SECOND if twice else FIRST):
        return "too slow"
    lines = err.splitlines()
    if "Traceback" in err or (not twice and not lines[-1].startswith("granpinn.train: stopped")):
        return f"message {lines[-1:]}"
    if phase != "imports" and checkpoint.newest(out / "checkpoint") is None:
        return "no checkpoint"
    return ""


def heard(process: subprocess.Popen[str], words: str) -> None:
    """Wait for a line of a process."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.strip() == words:
            return


def child(phase: str, slow: bool, argv: list[str]) -> int:
    """A training that announces a phase and stays in it for a while."""
    from granpinn.command import exit_codes

    exit_codes.guard_process("train")
    from granpinn.checks import resimulation
    from granpinn.commands import train
    from granpinn.report import page
    from granpinn.second_opinion import simulated_pressure
    from granpinn.training.trainer import Trainer
    from granpinn.uncertainty import sensitivity

    reached: list[str] = []

    def announced(real: Callable[..., Any], wanted: Callable[..., bool]) -> Callable[..., Any]:
        @functools.wraps(real)
        def wrapper(*args: Any, **kwargs: Any) -> Any:
            if reached or not wanted(*args):
                return real(*args, **kwargs)
            reached.append(phase)
            print(f"reached {phase}", flush=True)
            try:
                end = time.monotonic() + STAY
                while time.monotonic() < end:
                    time.sleep(0.01)
                return real(*args, **kwargs)
            except KeyboardInterrupt:
                clean_up()
                raise

        return wrapper

    def clean_up() -> None:
        if slow:
            print("cleaning up", flush=True)
            time.sleep(MINUTE)

    def save(*args: Any) -> Any:
        if reached and phase in ("pre-fit", "training"):
            clean_up()
        return real_save(*args)

    always = lambda *_: True  # noqa: E731
    real_save = checkpoint.save
    setattr(checkpoint, "save", save)  # noqa: B010
    places: dict[str, tuple[Any, str, Callable[..., bool]]] = {
        "pre-fit": (Trainer, "advance", lambda t: t.step > 50 and t.schedule.in_prefit(t.step)),
        "training": (Trainer, "advance", lambda t: t.step > 200),
        "last layer": (Trainer, "solve_last_layer", always),
        "copies": (sensitivity, "continued", always),
        "simulated pressure": (simulated_pressure, "settle", always),
        "resimulation": (resimulation, "resimulate", always),
        "figures": (page, "build", always),
    }
    owner, name, wanted = places[phase]
    setattr(owner, name, announced(getattr(owner, name), wanted))
    return train.main(argv)


if __name__ == "__main__":
    if "--child" in sys.argv:
        own, rest = sys.argv[1 : sys.argv.index("--")], sys.argv[sys.argv.index("--") + 1 :]
        raise SystemExit(child(own[1], "--slow" in own, rest))
    raise SystemExit(main())
