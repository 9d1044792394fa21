"""All populations of the coverage study in one command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.studies.coverage import films, remake, run

RESULTS = Path(remake.__file__).parent / "results"
TINY = ("--steps", "60", "--network.widths", "16,16", "--batch.interior", "64", "--device", "cpu")


@pytest.mark.parametrize("name", remake.POPULATIONS)
def test_results_are_those_of_the_words(name: str, tmp_path: Path) -> None:
    """The results of the repository have the flows and the steps that the words ask for."""
    asked = run.options(remake.words_of(name, RESULTS, tmp_path, []))
    found = json.loads(remake.results_of(name, RESULTS).read_text())
    assert [row["name"] for row in found["rows"]] == [task.name for task in asked.tasks]
    assert found["simulation"] == asked.grid
    assert (found["members"], found["steps"]) == (asked.own.members, asked.config.steps)
    assert ("V0" in found["settings"]) == (asked.config.level == "V0")


def test_tables_are_made_of_results_that_are_there() -> None:
    words = {w for command in remake.TABLES for w in command.split()[1:] if remake._is_file(w)}
    others = {"films", "films_19", "cells_1024"}
    assert words <= set(remake.POPULATIONS) | others
    assert all(remake.results_of(name, RESULTS).exists() for name in words)
    assert films.PAIRS == 50


def test_a_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two populations of one flow: it is simulated once, and what is there is not made again."""
    flow = "--truths 1 --controls 0 --draw 3 --cells 48 --stride 1 --frames 12"
    populations = {"clean": flow, "noisy": f"{flow} --noise 0.02"}
    monkeypatch.setattr(remake, "POPULATIONS", populations)
    out, flows = tmp_path / "results", tmp_path / "flows"
    out.mkdir()
    command = ["--flows", str(flows), "--out", str(out), *TINY]
    assert remake.main([*command, "--until", "-1"]) == 1
    assert "not made: clean, noisy" in capsys.readouterr().err
    assert remake.main(command) == 0
    assert len(list(flows.iterdir())) == 1
    rows = {
        name: json.loads(remake.results_of(name, out).read_text())["rows"] for name in populations
    }
    noise = {name: own[0]["measured_noise"] for name, own in rows.items()}
    assert noise["noisy"] > noise["clean"]
    remake.results_of("noisy", out).unlink()
    before = remake.results_of("clean", out).stat().st_mtime_ns
    assert remake.main(command) == 0
    assert remake.results_of("clean", out).stat().st_mtime_ns == before
    assert json.loads(remake.results_of("noisy", out).read_text())["rows"] == rows["noisy"]
