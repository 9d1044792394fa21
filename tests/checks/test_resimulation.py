"""The check by simulation: exact on simulated data, and a reason where it cannot start."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from granpinn.checks.resimulation import Curves, Resimulation, resimulate
from granpinn.data import Flow
from granpinn.physics.laws import DEFAULT
from granpinn.simulation import Collapse, simulate


def law(mu_s: float, mu_2: float) -> tuple[float, ...]:
    """The parameters of mu(I) with the paper's I0."""
    return mu_s, mu_2, 0.3


@pytest.fixture(scope="module")
def flow() -> Flow:
    return simulate(Collapse(0.4, 0.64, cells=64, stride=2, frames=20, t_end=3.0, threads=1))


def curves_of(found: Resimulation) -> Curves:
    assert found.curves is not None
    return found.curves


def test_the_true_law_gives_the_data_back(flow: Flow) -> None:
    summary = resimulate(flow, DEFAULT, law(0.4, 0.64))
    comparison = curves_of(summary)
    assert summary.objection is None
    assert summary.cells == 64
    assert summary.column == (1.0, 10.0)
    assert summary.common_percent == 100
    assert summary.velocity_percent == 0
    assert summary.front_percent == summary.profile_percent == 0
    np.testing.assert_array_equal(comparison.array("t"), flow.t)


def test_another_law_does_not(flow: Flow) -> None:
    summary = resimulate(flow, DEFAULT, law(0.2, 0.44))
    comparison = curves_of(summary)
    assert summary.velocity_percent is not None
    assert summary.front_percent is not None
    assert summary.velocity_percent > 5
    assert summary.front_percent > 1
    front, slid, error = map(comparison.array, ("front", "front_simulated", "velocity_percent"))
    assert slid[-1] > front[-1]  # it slides further
    assert error[-1] > error[2]


def late(flow: Flow) -> Flow:
    return dataclasses.replace(flow, t=flow.t + 1)


def moving(flow: Flow) -> Flow:
    return dataclasses.replace(flow, u=flow.u + np.float32(0.9))


def elsewhere(flow: Flow) -> Flow:
    return dataclasses.replace(flow, x=flow.x + 5)


def heap(flow: Flow) -> Flow:
    c = flow.c.copy()
    c[0, 10:, 0] = 0
    return dataclasses.replace(flow, c=c)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (late, "the first frame is not the start: its time is 1.15"),
        (moving, "not released from rest: they move at"),
        (elsewhere, "do not stand in the corner"),
        (heap, "the first frame is not a column: its grains fill"),
    ],
)
def test_what_is_no_column_at_rest_is_not_simulated(flow: Flow, change: object, words: str) -> None:
    assert callable(change)
    summary = resimulate(change(flow), DEFAULT, law(0.4, 0.64))
    assert summary.curves is None
    assert summary.objection is not None
    assert words in summary.objection
    assert summary.velocity_percent is None
    assert str(summary).startswith("not simulated again: ")


def test_a_flow_between_side_walls_has_them_again() -> None:
    """With their friction the simulator repeats it; with another one it does not."""
    settings = {"mu_s": 0.4, "mu_2": 0.64, "cells": 64, "stride": 1, "t_end": 3.0, "frames": 12}
    flow = simulate(**settings, wall_gap=1.0, wall_friction=0.2, threads=1)
    same, other = (
        resimulate(flow, DEFAULT, law(0.4, 0.64), wall_friction=friction).velocity_percent
        for friction in (0.2, 0.05)
    )
    assert same is not None
    assert other is not None
    assert same < 0.1
    assert other > 5
