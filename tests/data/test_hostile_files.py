"""Gate F-1: every damaged or hostile file gives one sentence within 15 s and 2 GiB."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from . import read_with_limits
from .hostile_edits import EDITS
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
