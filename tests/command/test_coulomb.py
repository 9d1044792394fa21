"""Constant friction end to end: simulate, inspect, train, resume, simulate again, report."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import pytest

from granpinn.data import read_flow
from granpinn.physics.laws import LAWS
from granpinn.report import __main__ as report
from granpinn.training.history import columns

COMMANDS = ("inspect", "simulate", "train")
inspect, simulate, train = (import_module(f"granpinn.{name}") for name in COMMANDS)
SMALL = ("--steps", "30", "--network.widths", "16,16", "--batch.interior", "64")
CELLS = ("--resimulation.cells", "32", "--simulated_pressure.cells", "32")


@pytest.mark.parametrize("form", ["mixed", "strong"])
def test_the_whole_chain(form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flow, run = tmp_path / "flow.h5", tmp_path / "run"
    column = ("--cells", "64", "--height", "1", "--aspect", "1", "--t-end", "1", "--frames", "60")
    options = ("--law", "coulomb", "--mu-s", "0.3", "--stride", "2", "--out", str(flow))
    assert simulate.main([*options, *column]) == 0
    truth = read_flow(flow).truth
    assert truth is not None
    assert (truth.law, truth.mu_s, truth.mu_2) == ("coulomb", 0.3, None)
    assert inspect.main([str(flow), "--law", "coulomb"]) == 0

    words = [str(flow), "--out", str(run), "--law", "coulomb", "--form", form, *SMALL]
    assert train.main([*words, "--resimulate", *CELLS, "--simulated_pressure.frames", "1"]) == 0
    assert report.main([str(run)]) == 0
    shown = capsys.readouterr().out
    assert "mu_s" in shown
    assert "mu_2" not in shown.split("report:")[0].rsplit("value", 1)[1]

    found = json.loads((run / "results.json").read_text())
    assert found["law"]["name"] == "coulomb"
    assert list(found["parameters"]) == ["mu_s"]
    assert 0.01 < found["parameters"]["mu_s"]["value"] < 3
    assert found["error_percent"]["mu_s"] is not None
    assert found["resimulation"]["objection"] is None
    header = (run / "history.csv").read_text().splitlines()[0]
    assert header == ",".join(columns(LAWS["coulomb"]))
    assert train.main([*words, "--resume", "--simulated_pressure.frames", "0"]) == 0
    again = json.loads((run / "results.json").read_text())
    assert again["parameters"] == found["parameters"]
