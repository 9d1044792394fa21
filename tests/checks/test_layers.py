"""Chutes in the simulator: the check by simulation and the simulated pressure."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn import results
from granpinn.checks import simulated_pressure
from granpinn.checks.resimulation import resimulate
from granpinn.commands import train
from granpinn.data import Flow, write_flow
from granpinn.physics.laws import DEFAULT
from granpinn.simulation import Chute, simulate
from tests.flows import make_chute
from tests.runs import SIMULATED_AGAIN

LAW = (0.3, 0.7, 0.3)


@pytest.fixture(scope="module")
def flow() -> Flow:
    """A layer of 20 grains that starts on a slope of 23 degrees."""
    chute = Chute(*LAW, slope=23.0, height=20.0, d=1.0, cells=16, frames=8, t_end=30.0, threads=1)
    return simulate(chute)


def test_the_true_law_gives_the_data_back(flow: Flow) -> None:
    summary = resimulate(flow, DEFAULT, LAW)
    assert summary.curves is not None
    assert summary.objection is None
    assert (summary.cells, summary.layer, summary.column) == (16, pytest.approx(20.0), None)
    assert summary.common_percent == 100
    assert summary.velocity_percent == pytest.approx(0, abs=0.01)
    assert set(summary.curves.front) == {None}
    assert "front" not in str(summary)


def test_the_columns_of_the_data_are_their_own(flow: Flow) -> None:
    """A file with other columns and coarser rows, which does not state the grid of a solver."""
    stated = {k: v for k, v in flow.attributes.items() if k != "grid_spacing_of_solver"}
    coarse = dataclasses.replace(
        flow,
        attributes={**stated, "period_x": 100.0},
        x=np.array([3.0, 20.0, 55.0]),
        y=flow.y[::2],
        **{name: getattr(flow, name)[:, ::2, :3] for name in ("u", "v", "c", "p")},
    )
    summary = resimulate(coarse, DEFAULT, LAW)
    assert summary.cells == 32
    assert summary.common_percent == 100
    assert summary.velocity_percent is not None
    assert summary.velocity_percent < 3  # 16 cells against 32, from rest


def steady_velocity(flow: Flow) -> simulated_pressure.Velocity:
    """The velocity of a file of one frame at any height."""
    full = flow.material[0, :, 0]

    def velocity(x: Any, y: Any, t: float) -> Any:
        return np.interp(y, flow.y[full], flow.u[0, full, 0]), np.zeros_like(y)

    return velocity


def test_pressure_of_a_steady_chute_is_the_weight_above() -> None:
    flow = make_chute()
    assert flow.p is not None
    found = simulated_pressure.at_frames(flow, DEFAULT, LAW, steady_velocity(flow), 3)
    assert not isinstance(found, str)
    assert list(found.at) == [0]
    full = flow.material[0]
    np.testing.assert_allclose(found.at[0][full], flow.p[0][full], atol=0.002 * flow.p[0].max())


OTHERS: dict[str, tuple[Callable[[Flow], Flow], str]] = {
    "late": (
        lambda flow: dataclasses.replace(flow, t=flow.t + 500),
        "the first frame is not the start: its time is",
    ),
    "moving": (
        lambda flow: dataclasses.replace(flow, u=flow.u + np.float32(50)),
        "the grains are not released from rest: they move at",
    ),
    "upwards": (
        lambda flow: dataclasses.replace(flow, gravity=(-0.4, -0.9)),
        "a chute of the simulator descends along x, by at most 60 degrees",
    ),
    "waves": (
        lambda flow: dataclasses.replace(
            flow, u=flow.u * (1 + 0.3 * np.sin(2 * np.pi * np.arange(8) / 8)).astype(np.float32)
        ),
        "the flow changes along x, and a layer of the simulator is even",
    ),
    "raised": (
        lambda flow: dataclasses.replace(flow, y=flow.y + 30),
        "the grains do not lie on the floor that the simulator has at y = 0",
    ),
    "steady": (
        lambda flow: dataclasses.replace(flow, attributes={**flow.attributes, "steady": 1}),
        "the flow is steady, and the simulator has only grains that start from rest",
    ),
    "endless": (
        lambda flow: dataclasses.replace(flow, t=flow.t + np.arange(8) * 1e7),
        "t_end must be at most",
    ),
}


@pytest.mark.parametrize(("change", "words"), OTHERS.values(), ids=OTHERS.keys())
def test_another_layer_is_left_out_with_the_reason(
    change: Callable[[Flow], Flow], words: str, flow: Flow
) -> None:
    summary = resimulate(change(flow), DEFAULT, LAW)
    assert summary.curves is None
    assert words in str(summary.objection)


def test_the_command_has_both_opinions(
    flow: Flow,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    figures: Callable[..., None],
) -> None:
    figures()
    write_flow(flow, tmp_path / "chute.h5")
    assert (
        train.main([str(tmp_path / "chute.h5"), "--out", str(tmp_path / "run"), *SIMULATED_AGAIN])
        == 0
    )
    printed = capsys.readouterr()
    assert "simulated again with this law: velocity off by" in printed.out
    assert "simulated pressure at" in printed.out
    found = results.read_results(tmp_path / "run" / "results.json")
    assert found.not_done == {}
    assert found.checks["resimulation"].layer == pytest.approx(20.0)
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert found.checks["resimulation"].words[1:] in page
    assert (tmp_path / "run" / "figures" / "resimulation.png").exists()
