"""The profile of the command: its seconds, and the functions that take them."""

from __future__ import annotations

import cProfile
import json
import sys
from pathlib import Path

import pytest

from bench import command_profile
from granpinn import train
from tests.command.late_parts import FLAGS

SLOW = "import time; print('heading', flush=True); time.sleep({}); print('mu_s 0.4', flush=True)"


def test_the_answer_comes_between_the_first_line_and_the_exit() -> None:
    found = command_profile.timed([sys.executable, "-c", SLOW.format(0.2)])
    assert 0 < found["first_line_s"] <= found["answer_s"] - 0.15 < found["exit_s"]
    assert found["cpu_s"] > 0


def test_a_command_that_fails_has_no_times() -> None:
    with pytest.raises(SystemExit, match="ended with 3"):
        command_profile.timed([sys.executable, "-c", "raise SystemExit(3)"])


@pytest.mark.usefixtures("no_report")
def test_the_functions_of_a_run_by_their_time(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def timed(words: list[str]) -> dict[str, float]:
        """The command within this process: it takes as long to load torch as to train."""
        profile = cProfile.Profile()
        assert profile.runcall(train.main, words[words.index("granpinn.train") + 1 :]) == 0
        if "-o" in words:
            profile.dump_stats(words[words.index("-o") + 1])
        return {"exit_s": 1.0}

    monkeypatch.setattr(command_profile, "timed", timed)
    out = tmp_path / "profile.json"
    words = ["command_profile", "--json", str(out), "--flow", str(flow_file), "--", *FLAGS]
    monkeypatch.setattr(sys, "argv", words)
    assert command_profile.main() == 0
    found = json.loads(out.read_text())
    assert (found["flow"], found["words"]) == (flow_file.name, FLAGS)
    names = [row["function"] for row in found["rows"]]
    for module, function in (("identification/single.py", "identify"), ("loop.py", "train")):
        assert any(module in name and name.endswith(f" {function}") for name in names)
    assert all(row["total_s"] >= row["own_s"] >= 0 for row in found["rows"])
    totals = [row["total_s"] for row in found["rows"]]
    assert totals == sorted(totals, reverse=True)
    assert str(tmp_path) not in out.read_text()
