"""Grains that hang between walls, identified: the result says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granpinn.commands import train
from granpinn.data import read_flow, write_flow
from granpinn.inspection import inspect
from granpinn.results import read_results
from tests.inspection.test_walls import silo

SIDES = "the wall from (12, 12) to (12, -1) and the wall from (18, 12) to (18, -1)"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_flow(silo(6.0), tmp_path / "silo.h5")
    return tmp_path / "silo.h5"


def test_inspect_warns_of_the_walls_first(path: Path) -> None:
    found = inspect(read_flow(path))
    assert found.sentences[0].startswith("A law from these data is not to be used: walls carry")
    assert f"the grains hang between {SIDES}" in str(found.numbers())


@pytest.mark.usefixtures("no_report")
@pytest.mark.filterwarnings("ignore::granpinn.data.FlowFileWarning")
def test_train_has_a_law_without_error_bars_that_is_not_to_be_used(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = ["--steps", "40", "--network.widths", "16,16", "--device", "cpu"]
    assert train.main([str(path), "--out", str(tmp_path / "run"), *few]) == 0
    text = capsys.readouterr().out
    values, (why, *_) = text.split("DO NOT USE"), text.splitlines()[4:]
    assert why.startswith("DO NOT USE    Walls carry the grains, by forces that are not known: ")
    assert "+-" not in values[0]
    assert "the error is not known: more than the base carries the grains" in values[0]
    assert np.isfinite(read_results(tmp_path / "run" / "results.json").theta).all()
