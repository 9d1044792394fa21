"""The seconds of the command."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from bench import command_profile

SLOW = "import time; print('heading', flush=True); time.sleep({}); print('mu_s 0.4', flush=True)"


def test_the_answer_comes_between_the_first_line_and_the_exit() -> None:
    found = command_profile.timed([sys.executable, "-c", SLOW.format(0.2)])
    assert 0 < found["first_line_s"] <= found["answer_s"] - 0.15 < found["exit_s"]
    assert found["cpu_s"] > 0


def test_a_command_that_fails_has_no_times() -> None:
    with pytest.raises(SystemExit, match="ended with 3"):
        command_profile.timed([sys.executable, "-c", "raise SystemExit(3)"])


def test_medians_of_the_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = iter([3.0, 9.0, 4.0])
    commands: list[list[str]] = []

    def timed(words: list[str]) -> dict[str, float]:
        commands.append(words)
        return {"exit_s": next(seconds)}

    monkeypatch.setattr(command_profile, "timed", timed)
    out = tmp_path / "profile.json"
    words = ["command_profile", "--json", str(out), "--flow", "a/flow.h5", "--", "--steps", "3"]
    monkeypatch.setattr(sys, "argv", words)
    assert command_profile.main() == 0
    found = json.loads(out.read_text())
    assert found["medians"] == {"exit_s": 4.0}
    assert (found["flow"], found["words"]) == (["flow.h5"], ["--steps", "3"])
    for command in commands:
        assert command[1:7] == ["-u", "-m", "granpinn.train", "a/flow.h5", "--steps", "3"]
