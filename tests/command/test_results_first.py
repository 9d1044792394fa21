"""A finished training is on disk before anything else can fail, and the rest fails alone."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from granpinn import identify, identify_many, results
from granpinn.command import training_run
from granpinn.data import Flow, read_flow
from granpinn.data.surface_sd import SURFACE_SD
from granpinn.errors import Interrupted
from granpinn.identification import finish, prediction, simulated_fields
from granpinn.identification.case import Case
from granpinn.output import OutputError
from granpinn.results import NotDone
from granpinn.results.attempt import (
    ASSUMPTIONS,
    BASELINE,
    FIELDS,
    PENDING,
    attempt,
    awaited,
)
from granpinn.second_opinion import resimulation, simulated_pressure
from granpinn.simulation import SimulationError
from tests.command.late_parts import FILES, missing, raising, run
from tests.runs import tiny

STAGE_ERRORS = [
    MemoryError("Unable to allocate 31 GiB"),
    SimulationError("the pressure did not converge"),
    RecursionError("deep\nand\x1b[2J long"),
]
ERRORS = [
    *STAGE_ERRORS,
    FloatingPointError("overflow"),
    ZeroDivisionError("division by zero"),
    RuntimeError("can't start new thread"),
    KeyError("a bug"),
    AssertionError(),
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
        assert result.simulated_pressure is not None
        assert (result.simulated_pressure.failed, result.not_done) == (2, ())
    else:
        assert result.simulated_pressure is None
        why = missing(result)["simulated pressure"]
        assert f"no simulated pressure: {why}" in capsys.readouterr().out
        assert why.isprintable()
    assert result.parameters.mu_s.value > 0
    assert result.error_percent.velocity is not None
    assert {path.name for path in (tmp_path / "run").iterdir()} >= FILES


def test_the_answer_comes_before_the_fields(flow_file: Path, tmp_path: Path) -> None:
    told: list[tuple[results.Result, bool]] = []

    def look(result: results.Result) -> None:
        told.append((result, (tmp_path / "fields.h5").exists()))

    flow = read_flow(flow_file)
    exact = {**flow.attributes, SURFACE_SD: 0.0}  # hence no effect of an assumption
    flow = dataclasses.replace(flow, attributes=exact)
    last = identify(flow, tiny(steps=3), run_dir=tmp_path, answered=look, known=look)
    (answer, written), (whole, written_then) = told
    assert (written, written_then) == (False, True)
    assert awaited(answer, FIELDS)
    assert not awaited(whole, FIELDS)
    assert answer.parameters == whole.parameters == last.parameters


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
    assert missing(without_fields) == dict.fromkeys((ASSUMPTIONS, BASELINE, FIELDS), PENDING)
    assert without_fields.theta == last.theta
    assert last.baseline is not None
    assert missing(last) == {FIELDS: "there is not enough memory"}


def test_everything_is_on_disk_when_the_simulator_begins(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[results.Result] = []
    real = simulated_pressure.at_frames

    def look(*args: Any, **kwargs: Any) -> Any:
        assert {path.name for path in tmp_path.iterdir()} >= FILES
        assert "p" in results.read_fields(tmp_path / "fields.h5").values
        found.append(results.read_results(tmp_path / "results.json"))
        return real(*args, **kwargs)

    monkeypatch.setattr(simulated_pressure, "at_frames", look)
    last = identify(flow_file, tiny(simulated_pressure__frames=2), run_dir=tmp_path)
    (before,) = found
    assert missing(before) == {"simulated pressure": PENDING}
    assert before.parameters == last.parameters
    assert last.not_done == ()
    assert results.read_results(tmp_path / "results.json").to_dict() == last.to_dict()
    assert "p_simulated" in results.read_fields(tmp_path / "fields.h5").values


@pytest.mark.usefixtures("no_report")
def test_a_signal_in_the_simulator_stops_and_resume_makes_the_rest(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(flow_file, "--out", tmp_path / "whole") == 0
    with monkeypatch.context() as patch:
        patch.setattr(simulated_pressure, "at_frames", raising(Interrupted(15, "stopped")))
        assert run(flow_file, "--out", tmp_path / "run") == 143
    left = results.read_results(tmp_path / "run" / "results.json")
    assert missing(left) == {"simulated pressure": PENDING}
    assert run("--out", tmp_path / "run", "--resume") == 0
    whole, resumed = (
        results.read_results(tmp_path / name / "results.json") for name in ("whole", "run")
    )
    assert resumed.not_done == ()
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
    assert result.loss is not None


@pytest.mark.parametrize("flag", ["--free-I0", "--resimulate", "--calibrate"])
@pytest.mark.usefixtures("no_report")
def test_what_a_flag_asks_for_fails_alone_with_exit_code_1(
    flag: str,
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(training_run, "profile_I0", raising(KeyError("a bug")))
    monkeypatch.setattr(training_run, "bootstrap", raising(KeyError("a bug")))
    monkeypatch.setattr(resimulation, "resimulate", raising(KeyError("a bug")))
    assert run(flow_file, "--out", tmp_path / "run", flag) == 1
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    assert err.splitlines()[-1].startswith("granpinn.train: no ")
    assert "mu_s" in out
    result = results.read_results(tmp_path / "run" / "results.json")
    assert len(missing(result)) == 1
    assert result.simulated_pressure is not None


@pytest.mark.usefixtures("no_report")
def test_a_kill_in_simulated_flows_leaves_them_pending(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training_run, "profile_I0", raising(KeyError("a bug")))
    monkeypatch.setattr(training_run, "bootstrap", raising(KeyboardInterrupt()))
    assert run(flow_file, "--out", tmp_path / "run", "--free-I0", "--calibrate") == 130
    result = results.read_results(tmp_path / "run" / "results.json")
    assert missing(result) == {
        "identification of simulated flows": PENDING,
        "profile of I0": "KeyError: 'a bug'",
    }


@pytest.mark.usefixtures("no_report")
def test_a_kill_in_the_profile_leaves_it_pending(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training_run, "profile_I0", raising(KeyboardInterrupt()))
    assert run(flow_file, "--out", tmp_path / "run", "--free-I0", "--resimulate") == 130
    result = results.read_results(tmp_path / "run" / "results.json")
    assert missing(result) == {
        "simulation with the identified law": PENDING,
        "profile of I0": PENDING,
    }


def test_a_member_of_a_batch_fails_alone(
    flow: Flow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = simulated_fields.pressures

    def second_fails(case: Case, *args: Any) -> Any:
        written = [(tmp_path / f"{e:03d}" / "results.json").exists() for e in range(3)]
        assert all(written)  # of all members, before the first simulation
        if case.config.seed == 1:
            raise MemoryError
        return real(case, *args)

    monkeypatch.setattr(simulated_fields, "pressures", second_fails)
    config = tiny(simulated_pressure__frames=1)
    found = identify_many([flow] * 3, config, [0, 1, 2], run_dir=tmp_path)
    assert [missing(result) for result in found] == [
        {},
        {"simulated pressure": "there is not enough memory"},
        {},
    ]
    for e, result in enumerate(found):
        written = results.read_results(tmp_path / f"{e:03d}" / "results.json")
        assert written.to_dict() == result.to_dict()
        values = results.read_fields(tmp_path / f"{e:03d}" / "fields.h5").values
        assert ("p_simulated" in values) == (e != 1)


def test_a_bug_in_one_member_leaves_the_files_of_the_others(
    flow: Flow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = finish.conclusion.result

    def first_fails(case: Case, *args: Any) -> Any:
        if case.config.seed == 0:
            raise KeyError("a bug")
        return real(case, *args)

    monkeypatch.setattr(finish.conclusion, "result", first_fails)
    with pytest.raises(KeyError, match="a bug"):
        identify_many([flow] * 2, tiny(), [0, 1], run_dir=tmp_path)
    assert results.read_results(tmp_path / "001" / "results.json").seed == 1


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: type(e).__name__)
def test_every_error_of_a_part_is_one_sentence(error: Exception) -> None:
    found = attempt("report", raising(error))
    assert isinstance(found, NotDone)
    assert found.what == "report"
    assert found.why.isprintable()
    assert found.why


def test_a_disk_that_is_full_is_no_missing_part() -> None:
    with pytest.raises(OutputError, match="no room"):
        attempt("report", raising(OutputError("no room")))
    with pytest.raises(KeyboardInterrupt):
        attempt("report", raising(KeyboardInterrupt()))
    assert attempt("report", lambda: 3) == 3
