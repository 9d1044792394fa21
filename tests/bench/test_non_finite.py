"""Gate T-5 puts its values into single steps, and into steps that graphs replay in stretches."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from bench.studies.reliability import runs
from bench.studies.reliability.non_finite import DATA, GRADIENTS, STATE, inject, make, one
from granpinn.training.graphs import Graphs
from granpinn.training.loop import TrainingLoop
from tests.training.test_graphs import record

STEP = 23  # inside of the stretch 20 to 24


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return runs.make_flow(tmp_path_factory.mktemp("flow") / "flow.h5")


def made(flow: Path, folder: Path, graphs: bool) -> TrainingLoop:
    run = make(flow, folder, "cpu")
    if graphs:
        run.trainer.graphs = Graphs(run.trainer.one_step, run.trainer.changing(), record)
    return run


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("name", ["points", "surface_pressure", *GRADIENTS, *STATE])
def test_a_value_is_noticed_in_its_stretch(
    name: str, times: int, small: Path, tmp_path: Path
) -> None:
    run = made(small, tmp_path, graphs=True)
    assert one(run, tmp_path, name, math.nan, STEP, times, 0.4) == ""


@pytest.mark.parametrize("graphs", [False, True])
@pytest.mark.parametrize("name", ["velocity", "grad_theta", "average.q"])
def test_every_value_is_put_in(name: str, graphs: bool, small: Path, tmp_path: Path) -> None:
    run = made(small, tmp_path, graphs)
    noticed = inject(run, name, math.inf, STEP, 1, 0.4)
    if name in DATA:
        with pytest.raises(RuntimeError, match="NaN or infinite"):
            run.train()
    else:
        run.train()
    first, last = (20, 24) if graphs else (STEP, STEP)
    assert [n[:2] for n in noticed[:1]] == [(first, last)]
    assert first <= noticed[0].seen <= last
