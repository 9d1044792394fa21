"""The attacks of bench/studies/reliability: repeatable, and every outcome has its name."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from bench.studies.reliability import damage, sandbox
from bench.studies.reliability.judge import judged

MANY = "1 2 3\n4 5 6\n" * 20


@pytest.mark.parametrize("content", [MANY.encode(), bytes(99)])
def test_damage_is_a_function_of_the_seed(content: bytes) -> None:
    made = [damage.damaged(content, Random(f"{k}"), b"other") for k in range(200)]
    assert made == [damage.damaged(content, Random(f"{k}"), b"other") for k in range(200)]
    assert len(set(made)) > 150
    assert max(map(len, made)) <= damage.MOST


def outcome(tmp_path: Path, command: Callable[[], Any], seconds: float = 5) -> str:
    work = tmp_path / "work"
    work.mkdir()
    valid = sandbox.run(lambda: 0, lambda: None, work)
    found = sandbox.run(command, lambda: None, work, seconds=seconds)
    return judged(found, "train", work, valid)


def refuse(text: str, code: int = 2) -> int:
    os.write(2, text.encode())
    return code


def open_outside() -> None:
    with pytest.raises(OSError, match="granpinn-nothing"):
        Path("/granpinn-nothing").read_bytes()


COMMANDS: dict[str, tuple[Callable[[], Any], str]] = {
    "ok": (lambda: 0, "ok"),
    "refused": (lambda: refuse("granpinn.train: no\n"), "refused"),
    "could not go on": (lambda: refuse("granpinn.train: no\n", 1), "could not go on"),
    "bug": (lambda: refuse("granpinn.train: E: this is a bug of granpinn\n", 1), "bug"),
    "two sentences": (lambda: refuse("granpinn.train: a\ngranpinn.train: b\n"), "no single"),
    "no sentence": (lambda: refuse(""), "no single sentence"),
    "other code": (lambda: 3, "exit code 3"),
    "exception": (lambda: 1 // 0, "traceback"),
    "crash": (os.abort, "crash (signal 6)"),
    "hang": (lambda: time.sleep(9), "hang"),
    "foreign file": (open_outside, "foreign file opened"),
    "connection": (lambda: socket.create_connection(("127.0.0.1", 9)), "process or connection"),
    "process": (lambda: os.system("true"), "process or connection"),
    "left over": (lambda: Path(".a.tmp").write_text(""), "temporary file left"),
    "memory": (lambda: len(b"x" * 300_000_000) * 0, "too much memory"),
}


@pytest.mark.parametrize(("command", "name"), COMMANDS.values(), ids=COMMANDS.keys())
def test_every_outcome_has_its_name(tmp_path: Path, command: Callable[[], Any], name: str) -> None:
    found = outcome(tmp_path, command, 1.0 if name == "hang" else 5.0)
    assert found.startswith(name)


def test_what_happens_before_the_command_is_not_its_failure(tmp_path: Path) -> None:
    work = tmp_path / "work"
    work.mkdir()
    found = sandbox.run(lambda: 0, os.abort, work)
    assert judged(found, "train", work, None) == "input not made"
