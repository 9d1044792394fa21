"""A result is on disk before the copies for its assumptions train, and they fail alone."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from granpinn import identify, results
from granpinn.identification.answer import ASSUMPTIONS, CURVE
from granpinn.results.attempt import PENDING
from granpinn.training import continuation
from granpinn.training.trainer import Trainer
from granpinn.uncertainty import error_bars, sensitivity
from tests.command.late_parts import FILES, missing, raising, run
from tests.runs import tiny

# What needs the effect of the assumptions, and what follows it.
LATE = (CURVE, "momentum_balance", "simulated_pressure", ASSUMPTIONS)


def test_everything_is_on_disk_when_the_copies_begin(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[results.Result] = []
    real = sensitivity.continued

    def look(*args: Any) -> Any:
        assert {path.name for path in tmp_path.iterdir()} >= FILES
        found.append(results.read_results(tmp_path / "results.json"))
        return real(*args)

    monkeypatch.setattr(sensitivity, "continued", look)
    monkeypatch.setattr(error_bars, "untested", lambda config: [])
    last = identify(flow_file, tiny(steps=200, simulated_pressure__frames=1), run_dir=tmp_path)
    (before,) = found
    assert missing(before) == dict.fromkeys(LATE, PENDING)
    (line,) = before.assumptions
    assert (line.derivative, line.why) == (None, PENDING)
    assert (before.error_bars, before.covariance) == (None, None)
    assert before.theta == last.theta
    assert last.not_done == {}
    assert last.error_bars is not None
    assert last.error_bars.assumptions is not None
    assert last.error_percent.velocity == before.error_percent.velocity
    assert results.read_results(tmp_path / "results.json").to_dict() == last.to_dict()


@pytest.mark.usefixtures("no_report")
def test_the_copies_fail_alone(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensitivity, "continued", raising(KeyError("a bug")))
    assert run(flow_file, "--out", tmp_path / "run") == 0
    result = results.read_results(tmp_path / "run" / "results.json")
    why = "KeyError: 'a bug'"
    assert missing(result) == {ASSUMPTIONS: why}
    assert f"no {ASSUMPTIONS}: {why}" in result.summary()
    (line,) = result.assumptions
    assert (line.derivative, line.why) == (None, why)
    assert result.parameters.mu_s.value > 0
    assert "simulated_pressure" in result.checks


@pytest.mark.usefixtures("no_report")
def test_ctrl_c_in_the_copies_stops_and_resume_makes_the_rest(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(flow_file, "--out", tmp_path / "whole") == 0
    real = continuation.Trainer.advance

    def interrupted(trainer: Trainer) -> None:
        real(trainer)
        if len(trainer.params) == 2:  # the copies
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(continuation.Trainer, "advance", interrupted)
        assert run(flow_file, "--out", tmp_path / "run") == 130
    left = results.read_results(tmp_path / "run" / "results.json")
    assert missing(left) == dict.fromkeys(LATE, PENDING)
    assert "its effect is not known: the run ended before it; --resume" in left.summary()
    assert run("--out", tmp_path / "run", "--resume") == 0
    whole, resumed = (
        results.read_results(tmp_path / name / "results.json") for name in ("whole", "run")
    )
    assert resumed.not_done == {}
    assert resumed.parameters == whole.parameters
    assert resumed.theta == left.theta
    assert resumed.assumptions == whole.assumptions != left.assumptions
