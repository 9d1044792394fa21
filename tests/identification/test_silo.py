"""A simulated silo, identified: walls carry a part of its weight, and the result says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granpinn.commands import simulate, train
from granpinn.data import read_flow
from granpinn.inspection import inspect
from granpinn.results import read_results

SIDES = "the wall from (0, 45) to (0, 0) and the wall from (20, 0) to (20, 45)"


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("flows") / "silo.h5"
    shape = ["--width", "20", "--height", "45", "--outlet", "10", "--d", "1", "--cells", "32"]
    grid = ["--t-end", "8", "--frames", "8", "--threads", "1", "--out", str(out)]
    assert simulate.main(["silo", *shape, *grid]) == 0
    return out


def test_inspect_warns_of_the_walls_first(path: Path) -> None:
    found = inspect(read_flow(path))
    assert found.sentences[0].startswith("A law from these data is not to be used: walls carry")
    assert f"the grains hang between {SIDES}" in str(found.numbers())


@pytest.mark.usefixtures("no_report")
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
    result = read_results(tmp_path / "run" / "results.json")
    assert np.isfinite(result.theta).all()
