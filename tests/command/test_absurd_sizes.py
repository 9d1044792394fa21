"""Sizes that a file states cost neither memory nor the result of a training."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest

from granpinn import results
from granpinn.data import Flow, write_flow
from tests.command.late_parts import run

# What a file may say about its box, with the unit of another length or none at all.
LENGTHS = [12000.0, 1e12, 1e308, 1e-12, 5e-324]


@pytest.mark.parametrize("value", LENGTHS)
@pytest.mark.parametrize("name", ["box_height", "box_width", "domain_size"])
@pytest.mark.usefixtures("no_report")
def test_a_box_of_another_unit_costs_no_memory_and_no_result(
    name: str,
    value: float,
    flow: Flow,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "flow.h5"
    write_flow(flow, path)
    with h5py.File(path, "r+") as file:
        file.attrs[name] = value
    possible = 1e-30 <= value <= 1e30
    assert run(path, "--out", tmp_path / "run") == (0 if possible else 2)
    if not possible:
        assert f"the attribute '{name}' must be 0 or from" in capsys.readouterr().err
        return
    assert results.read_results(tmp_path / "run" / "results.json").not_done == {}
