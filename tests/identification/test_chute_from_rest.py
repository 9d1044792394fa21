"""A simulated chute from rest, identified: its law, and the weight of the layer as pressure."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn.config import Config, Network
from granpinn.data import Flow
from granpinn.identification.identify import identify
from granpinn.physics.laws import mu_of_i
from granpinn.simulation import Chute, simulate
from granpinn.uncertainty import error_bars

LAW = (0.3, 0.7, 0.3)
WITHIN_LAW, WITHIN_PRESSURE = 3.0, 2.0  # per cent
WITHIN_I0 = 0.15


@pytest.fixture(scope="module")
def flow() -> Flow:
    chute = Chute(*LAW, slope=24.2, height=20.0, d=1.0, cells=24, frames=50, t_end=150.0, threads=1)
    return simulate(chute)


@pytest.mark.parametrize("noise", [0.0, pytest.param(0.02, marks=pytest.mark.long)])
def test_law_and_pressure_of_a_chute_from_rest(noise: float, flow: Flow) -> None:
    config = Config(steps=4000, network=Network(widths=(32, 32, 32)), noise=noise, device="cpu")
    result = identify(flow, config)
    assert result.law.I_range is not None
    covered = np.geomspace(*result.law.I_range, 5)
    error = 100 * (mu_of_i.friction(covered, *result.theta) / mu_of_i.friction(covered, *LAW) - 1)
    assert np.abs(error).max() < WITHIN_LAW
    assert result.error_percent.pressure is not None
    assert result.error_percent.pressure < WITHIN_PRESSURE


def test_a_steep_chute_determines_I0(flow: Flow, monkeypatch: pytest.MonkeyPatch) -> None:
    """The training has another I0; the curvature of mu(I) shows the true one."""
    monkeypatch.setattr(error_bars, "untested", lambda config: [])
    small = Network(widths=(32, 32, 32))
    config = Config(steps=4000, network=small, device="cpu", I0=0.2, checks="unknown_I0")
    check = identify(flow, config).checks["unknown_I0"]
    assert check.parameters["I0"].value == pytest.approx(LAW[2], rel=WITHIN_I0)
    low, high = check.parameters["I0"].interval_90
    assert low < LAW[2] < high
    assert f"I0 {check.parameters['I0'].words}" in check.words
