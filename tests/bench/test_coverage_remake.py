"""All populations of the coverage study in one command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from bench.studies.coverage import remake, run, table

TINY = ("--steps", "60", "--network.widths", "16,16", "--batch.interior", "64", "--device", "cpu")


def as_asked(name: str, folder: Path) -> bool:
    """Whether the table of the repository has the flows and the steps that the words ask for."""
    asked = run.options(remake.words_of(name, folder, folder, []))
    with table.PATH.open(newline="") as file:
        rows = (cells for cells in csv.DictReader(file) if cells["population"] == name)
        # Silos, which the simulator no longer has: bench/studies/coverage/materials.py.
        found = [cells for cells in rows if cells["law"] != "silo"]
    same = [cells["name"] for cells in found] == [task.name for task in asked.tasks]
    return same and all(
        len(cells["mu_s"].split()) == asked.config.members
        and (int(cells["steps"]), cells["level"]) == (asked.config.steps, asked.config.level)
        for cells in found
    )


@pytest.mark.parametrize("name", remake.POPULATIONS)
def test_stored_rows_are_those_of_the_words(name: str, tmp_path: Path) -> None:
    assert as_asked(name, tmp_path)


@pytest.mark.long
def test_a_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two populations of one flow: it is simulated once, and what is there is not made again."""
    flow = "--truths 1 --controls 0 --draw 3 --cells 48 --stride 1 --frames 12"
    populations = {"clean": flow, "noisy": f"{flow} --noise 0.02"}
    monkeypatch.setattr(remake, "POPULATIONS", populations)
    out, flows = tmp_path / "results", tmp_path / "flows"
    out.mkdir()
    command = ["--flows", str(flows), "--out", str(out), *TINY]
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
