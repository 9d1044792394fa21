"""A finished training is on disk before anything else can fail, and the rest fails alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from granpinn import identify, identify_many, results
from granpinn.checks import simulated_pressure
from granpinn.checks import simulated_pressure as pressure_check
from granpinn.data import Flow
from granpinn.errors import Interrupted
from granpinn.fit import prediction
from granpinn.identification.answer import ASSUMPTIONS, CURVE, FIELDS
from granpinn.output import OutputError
from granpinn.results.attempt import PENDING, attempt
from granpinn.simulation import SimulationError
from tests.command.late_parts import FILES, missing, raising, run
from tests.runs import tiny

PRESSURE = "simulated_pressure"


STAGE_ERRORS = [
    MemoryError("Unable to allocate 31 GiB"),
    SimulationError("the pressure did not converge"),
    RecursionError("deep\nand\x1b[2J long"),
]


@pytest.mark.parametrize("error", STAGE_ERRORS, ids=lambda e: type(e).__name__)
@pytest.mark.usefixtures("no_report")
def test_the_simulated_pressure_fails_alone(
    error: Exception,
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(simulated_pressure, "settle", raising(error))
    assert run(flow_file, "--out", tmp_path / "run") == 0
    result = results.read_results(tmp_path / "run" / "results.json")
    if isinstance(error, SimulationError):  # a frame that does not converge is left out
        assert (result.checks[PRESSURE].failed, result.not_done) == (2, {})
    else:
        assert PRESSURE not in result.checks
        why = missing(result)[PRESSURE]
        assert f"no simulated pressure: {why}" in capsys.readouterr().out
        assert why.isprintable()
    assert result.parameters.mu_s.value > 0
    assert result.error_percent.velocity is not None
    assert {path.name for path in (tmp_path / "run").iterdir()} >= FILES


def test_values_are_on_disk_before_the_fields(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[results.Result] = []

    def look(*args: Any) -> Any:
        found.append(results.read_results(tmp_path / "results.json"))
        raise MemoryError

    monkeypatch.setattr(prediction, "predict", look)
    last = identify(flow_file, tiny(steps=3), run_dir=tmp_path)
    (without_fields,) = found
    parts = (FIELDS, CURVE, "momentum_balance", PRESSURE, ASSUMPTIONS)
    assert missing(without_fields) == dict.fromkeys(parts, PENDING)
    assert without_fields.theta == last.theta
    assert "momentum_balance" in last.checks
    assert missing(last) == {FIELDS: "there is not enough memory"}


def test_everything_is_on_disk_when_the_simulator_begins(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[results.Result] = []
    real = pressure_check.at_frames

    def look(*args: Any, **kwargs: Any) -> Any:
        assert {path.name for path in tmp_path.iterdir()} >= FILES
        assert "p" in results.read_fields(tmp_path / "fields.h5").values
        found.append(results.read_results(tmp_path / "results.json"))
        return real(*args, **kwargs)

    monkeypatch.setattr(pressure_check, "at_frames", look)
    last = identify(flow_file, tiny(simulated_pressure__frames=2), run_dir=tmp_path)
    (before,) = found
    assert missing(before) == {PRESSURE: PENDING}
    assert before.parameters == last.parameters
    assert last.not_done == {}
    assert results.read_results(tmp_path / "results.json").to_dict() == last.to_dict()
    assert "p_simulated" in results.read_fields(tmp_path / "fields.h5").values


@pytest.mark.usefixtures("no_report")
def test_a_signal_in_the_simulator_stops_and_resume_makes_the_rest(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(flow_file, "--out", tmp_path / "whole") == 0
    with monkeypatch.context() as patch:
        patch.setattr(pressure_check, "at_frames", raising(Interrupted(15, "stopped")))
        assert run(flow_file, "--out", tmp_path / "run") == 143
    left = results.read_results(tmp_path / "run" / "results.json")
    assert missing(left) == {PRESSURE: PENDING}
    assert run("--out", tmp_path / "run", "--resume") == 0
    whole, resumed = (
        results.read_results(tmp_path / name / "results.json") for name in ("whole", "run")
    )
    assert resumed.not_done == {}
    assert resumed.parameters == whole.parameters == left.parameters
    assert resumed.error_percent == whole.error_percent


@pytest.mark.usefixtures("no_report")
def test_fields_that_cannot_be_made_leave_the_values(
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(prediction, "predict", raising(MemoryError()))
    assert run(flow_file, "--out", tmp_path / "run") == 1
    err = capsys.readouterr().err.splitlines()[-1]
    expected = "granpinn.train: no fields: there is not enough memory; the other results are valid"
    assert err == expected
    result = results.read_results(tmp_path / "run" / "results.json")
    assert result.parameters.mu_s.value > 0
    assert result.residuals is not None


def test_a_member_of_a_batch_fails_alone(
    flow: Flow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = pressure_check.velocity_of
    begun = []

    def second_fails(flow: Flow, model: Any) -> Any:
        written = [(tmp_path / f"{e:03d}" / "results.json").exists() for e in range(3)]
        assert all(written)  # of all members, before the first simulation
        begun.append(flow)
        if len(begun) == 2:
            raise MemoryError
        return real(flow, model)

    monkeypatch.setattr(pressure_check, "velocity_of", second_fails)
    config = tiny(simulated_pressure__frames=1)
    found = identify_many([flow] * 3, config, [0, 1, 2], run_dir=tmp_path)
    assert [missing(result) for result in found] == [
        {},
        {PRESSURE: "there is not enough memory"},
        {},
    ]
    for e, result in enumerate(found):
        written = results.read_results(tmp_path / f"{e:03d}" / "results.json")
        assert written.to_dict() == result.to_dict()
        values = results.read_fields(tmp_path / f"{e:03d}" / "fields.h5").values
        assert ("p_simulated" in values) == (e != 1)


def test_a_disk_that_is_full_is_no_missing_part() -> None:
    with pytest.raises(OutputError, match="no room"):
        attempt(raising(OutputError("no room")))
    with pytest.raises(KeyboardInterrupt):
        attempt(raising(KeyboardInterrupt()))
    assert attempt(lambda: 3) == 3
