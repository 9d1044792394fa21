"""The page and its figures fail alone, after everything else is on disk."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from granpinn import identify, results
from granpinn.command import training_run
from granpinn.figures import album
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
    assert run(flow_file, "--out", tmp_path / "run", "--simulated_pressure.frames", 0) == 0
    page = (tmp_path / "run" / "report.html").read_text()
    assert f"<li>{title}: " in page
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
    results.write_results(result.without("unknown_I0", "a <b> reason"), tmp_path / "results.json")
    page = training_run.report.build(tmp_path).read_text()
    assert "<li>Unknown i0: a &lt;b&gt; reason</li>" in page


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
