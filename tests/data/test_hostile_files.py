"""Gate F-1: every damaged or hostile file gives one sentence within 15 s and 2 GiB."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from . import read_with_limits
from .hostile_edits import EDITS, OUTSIDE
from .hostile_files import DAMAGES, make_hostile_files

Outcome = tuple[str, str, str]


def _run(paths: list[Path]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(read_with_limits.__file__), *map(str, paths)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome]:
    """For every file: kind of outcome, message, expected part of the message."""
    files = make_hostile_files(tmp_path_factory.mktemp("hostile"))
    waiting, found = list(files), dict[str, Outcome]()
    while waiting:
        run = _run(waiting)
        reports = [json.loads(line) for line in run.stdout.splitlines()]
        for path, kind, message, _ in reports:
            found[Path(path).parent.name] = (kind, message, files[Path(path)])
        waiting = waiting[len(reports) :]
        if run.returncode != 0:
            fatal = waiting.pop(0)
            reason = f"died with {run.returncode}: {run.stderr[-300:]}"
            found[fatal.parent.name] = ("died", reason, files[fatal])
    return found


def test_there_are_enough_of_them() -> None:
    assert len(EDITS) + len(DAMAGES) >= 40


@pytest.mark.parametrize("name", [*EDITS, *DAMAGES])
def test_is_refused_in_one_sentence(name: str, outcomes: dict[str, Outcome]) -> None:
    kind, message, expected = outcomes[name.replace(" ", "_")]
    assert kind == "FlowFileError", f"{kind}: {message}"
    path, sentence = message.split(": ", 1)
    assert path.endswith("flow.h5")
    assert expected in sentence
    assert "\n" not in sentence
    assert ": " in sentence, "the sentence must end in what to do"
    assert len(sentence) < 500


@pytest.mark.parametrize("name", ["external link", "external storage", "virtual dataset"])
def test_the_trap_would_spring(name: str, tmp_path: Path) -> None:
    """A careless reader does open the file outside, so that the files above prove something."""
    path, fifo = tmp_path / "flow.h5", tmp_path / OUTSIDE
    with h5py.File(path, "w") as file:
        file["u"] = np.zeros((12, 24, 20), dtype=np.float32)
        EDITS[name][0](file)
    os.mkfifo(fifo)
    careless = "import h5py, sys; h5py.File(sys.argv[1])['u'][:]"
    with subprocess.Popen([sys.executable, "-c", careless, path], cwd=tmp_path) as reader:
        try:
            opened = False
            while not opened and reader.poll() is None:
                time.sleep(0.01)
                opened = is_being_read(fifo)
            assert opened, "the careless reader came through without the FIFO"
        finally:
            reader.kill()


def is_being_read(fifo: Path) -> bool:
    """Whether some process has opened the FIFO for reading, or waits in opening it."""
    try:
        os.close(os.open(fifo, os.O_WRONLY | os.O_NONBLOCK))
    except OSError:
        return False
    return True
