"""The page and its figures fail alone, after everything else is on disk."""

from __future__ import annotations

import dataclasses
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn import identify, results
from granpinn.command import training_run
from granpinn.config import Config
from granpinn.figures import album
from granpinn.output import OutputError
from granpinn.results import NotDone
from granpinn.second_opinion import simulated_pressure
from tests.command.late_parts import missing, raising, run
from tests.runs import tiny


def test_a_figure_fails_alone(
    flow_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    figures: Callable[..., None],
) -> None:
    figures("velocity", "evolution")
    error = RecursionError("deep\nand\x1b[2J long")
    title, _ = album.FIGURES["velocity"]
    monkeypatch.setitem(album.FIGURES, "velocity", (title, raising(error)))
    monkeypatch.setattr("granpinn.report.film.shoot", raising(error))
    assert run(flow_file, "--out", tmp_path / "run", "--simulated_pressure.frames", 0) == 0
    page = (tmp_path / "run" / "report.html").read_text()
    assert f"<li>{title}: " in page
    assert "<li>Fields over time: " in page
    assert not (tmp_path / "run" / "figures" / "velocity.png").exists()
    assert (tmp_path / "run" / "figures" / "evolution.png").exists()


def test_the_page_fails_alone(
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    figures: Callable[..., None],
) -> None:
    figures("velocity")
    monkeypatch.setattr(training_run.report, "build", raising(RuntimeError("no page today")))
    assert run(flow_file, "--out", tmp_path / "run") == 0
    result = results.read_results(tmp_path / "run" / "results.json")
    assert missing(result) == {"report": "RuntimeError: no page today"}
    assert "no report: RuntimeError: no page today" in capsys.readouterr().out


def test_a_page_names_what_was_not_done(
    flow_file: Path, tmp_path: Path, figures: Callable[..., None]
) -> None:
    figures()
    result = identify(flow_file, tiny(steps=3), run_dir=tmp_path)
    lacking = dataclasses.replace(result, not_done=(NotDone("profile of I0", "a <b> reason"),))
    results.write_results(lacking, tmp_path / "results.json")
    page = training_run.report.build(tmp_path).read_text()
    assert "<li>Profile of i0: a &lt;b&gt; reason</li>" in page


def test_figures_are_drawn_while_the_pressure_is_simulated(
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    figures: Callable[..., None],
) -> None:
    figures("evolution")
    real, written = simulated_pressure.settle, []
    first = tmp_path / "run" / "figures" / "evolution.png"

    def settle(*args: Any) -> Any:
        end = time.monotonic() + 60
        while not first.exists() and time.monotonic() < end:
            time.sleep(0.01)
        written.append(first.read_bytes())
        return real(*args)

    monkeypatch.setattr(simulated_pressure, "settle", settle)
    assert run(flow_file, "--out", tmp_path / "run") == 0
    assert written == [first.read_bytes()] * 2  # frames
    assert (first.parent / "pressure_simulated.png").exists()
    out = capsys.readouterr().out
    assert out.index("mu_s") < out.index("simulated pressure at 2 times")


def test_early_figures_that_cannot_be_written_are_those_of_the_page(
    flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training_run.early, "draw", raising(OutputError("the disk is full")))
    given = []

    def build(folder: Path, **made: Any) -> Path:
        given.append(made)
        return folder / "report.html"

    monkeypatch.setattr(training_run.report, "build", build)
    assert run(flow_file, "--out", tmp_path / "run") == 0
    assert given == [{"prepared": training_run.Prepared()}]
    result = results.read_results(tmp_path / "run" / "results.json")
    assert result.not_done == ()
    assert result.simulated_pressure is not None


@pytest.mark.usefixtures("no_report")
def test_a_folder_that_vanishes_is_an_error(
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "run"

    def removed(*args: object, **kwargs: object) -> Path:
        shutil.rmtree(folder)
        folder.mkdir()
        return folder / "report.html"

    monkeypatch.setattr(training_run.report, "build", removed)
    assert run(flow_file, "--out", folder) == 1
    err = capsys.readouterr().err.splitlines()[-1]
    assert err.startswith(f"granpinn.train: {folder} was removed during the run")


@pytest.mark.parametrize("device", ["cpu", "cuda"])
def test_processes_draw_the_figures_of_a_training_on_a_gpu(
    device: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training_run, "choose_device", lambda name: torch.device(device))
    monkeypatch.setattr("granpinn.report.painters.PROGRAM", "granpinn.report.no_such_program")
    with training_run._painters(Config(out=str(tmp_path))) as painters:
        assert (painters is None) == (device == "cpu")
