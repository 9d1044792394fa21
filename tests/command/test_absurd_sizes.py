"""Sizes that a file states cost neither memory nor the result of a training."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

from granpinn import results
from granpinn.checks import simulated_pressure
from granpinn.checks.resimulation import resimulate
from granpinn.data import Flow, write_flow
from granpinn.physics.laws import LAWS
from tests.command.late_parts import raising, run

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
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(simulated_pressure, "settle", raising(AssertionError("was simulated")))
    path = tmp_path / "flow.h5"
    write_flow(flow, path)
    with h5py.File(path, "r+") as file:
        file.attrs[name] = value
    possible = 1e-30 <= value <= 1e30
    assert run(path, "--out", tmp_path / "run") == (0 if possible else 2)
    if not possible:
        assert f"the attribute {name} must be from" in capsys.readouterr().err
        return
    checks = results.read_results(tmp_path / "run" / "results.json").checks
    record = checks["simulated_pressure"]
    assert record.objection is not None
    assert "column" in record.objection or "box" in record.objection


def test_an_endless_simulation_is_not_begun(flow: Flow) -> None:
    corner = dataclasses.replace(flow, attributes={})
    late = dataclasses.replace(
        corner,
        t=np.append(flow.t[:-1], 1e9),
        u=np.zeros_like(flow.u),
        v=np.zeros_like(flow.v),
        c=np.broadcast_to(
            ((flow.y[:, None] < 0.9) & (flow.x < 0.5)).astype(np.float32), flow.c.shape
        ),
    )
    late = dataclasses.replace(late, t=late.t - late.t[0])
    summary = resimulate(late, LAWS["mu_of_i"], (0.4, 0.64, 0.3))
    assert summary.curves is None
    assert "t_end must be at most" in (summary.objection or "")
