"""Small trainings as processes, and what two of them must have in common.

A run that was stopped and resumed must end in the same bits as one that was not: the values of
results.json, every variable of fields.h5, history.csv without its times, and the tensors of the
newest checkpoint.
"""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from granpinn.simulation import Collapse, simulate
from granpinn.training import checkpoint

# Values of results.json that depend on the clock or on how the command was called.
VOLATILE = ("timing", "settings", "versions", "device")


def make_flow(path: Path) -> Path:
    """A small simulated collapse, in about a second."""
    if not path.exists():
        simulate(Collapse(0.4, 0.64, cells=64, frames=12, stride=2), out=path)
    return path


def command(flow: Path, out: Path, flags: list[str]) -> list[str]:
    """The command line of a training that begins, or goes on where there is a checkpoint."""
    train = [sys.executable, "-m", "granpinn.train"]
    return [*train, str(flow), "--out", str(out), "--resume", *flags]


def start(argv: list[str]) -> subprocess.Popen[str]:
    """A process in a group of its own, with one thread."""
    return subprocess.Popen(
        argv,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def children(pid: int) -> list[int]:
    """The processes that a process started."""
    path = Path(f"/proc/{pid}/task/{pid}/children")
    with suppress(OSError):
        return [int(word) for word in path.read_text().split()]
    return []


def end(process: subprocess.Popen[str]) -> None:
    """Kill a process and those that it started."""
    for pid in (*children(process.pid), process.pid):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def wait_until(process: subprocess.Popen[str], seconds: float) -> bool:
    """Whether a process ended by itself within so many seconds."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    return process.poll() is not None


def training_time(folder: Path) -> float:
    """Seconds of training at the last whole row of all histories; 0 without any."""
    latest = 0.0
    for path in folder.rglob("history.csv"):
        text = path.read_text()
        rows = list(csv.reader(text[: text.rfind("\n") + 1].splitlines()))
        if len(rows) > 1:
            latest = max(latest, float(rows[-1][1]))
    return latest


def difference(one: Path, other: Path) -> str | None:
    """What differs between two finished run folders; None: nothing but what clocks show."""
    contents = [_results(folder) for folder in (one, other)]
    for key in contents[0]:
        if contents[0][key] != contents[1].get(key):
            return f"results.json: {key}"
    for path in sorted(one.rglob("history.csv")):
        name = path.relative_to(one)
        if _history(path) != _history(other / name):
            return str(name)
    if (found := _fields(one / "fields.h5", other / "fields.h5")) is not None:
        return found
    states = [checkpoint.newest(folder / "checkpoint") for folder in (one, other)]
    if states[0] is None or states[1] is None:
        return "checkpoint: missing"
    for key, tensor in states[0].tensors.items():
        if tensor.numpy().tobytes() != states[1].tensors[key].numpy().tobytes():
            return f"checkpoint: {key}"
    return None


def _results(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "results.json").read_text())
    for found in filter(None, content["checks"].values()):
        found.pop("seconds", None)
    return {name: value for name, value in content.items() if name not in VOLATILE}


def _history(path: Path) -> list[list[str]]:
    rows = csv.reader(path.read_text().splitlines())
    return [[cell for column, cell in enumerate(row) if column != 1] for row in rows]


def _fields(one: Path, other: Path) -> str | None:
    with h5py.File(one) as a, h5py.File(other) as b:
        if set(a) != set(b):
            return "fields.h5: other variables"
        for name in a:
            if np.asarray(a[name]).tobytes() != np.asarray(b[name]).tobytes():
                return f"fields.h5: {name}"
    return None
