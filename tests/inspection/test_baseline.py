"""The baseline: points, standard errors, and the reasons for its absence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow, add_noise
from granpinn.inspection.momentum_balance import baseline
from granpinn.simulation import Collapse, simulate
from granpinn.simulation.silo import Silo
from tests.inspection.chutes import TANGENT, chute, number_of


def test_the_shipped_collapse(demo: Flow) -> None:
    """mu(I) = 0.4 + 0.24 I/(I + 0.3) is within two standard errors, and these are small."""
    found = baseline(demo)
    assert found.reason is None
    assert found.mean is not None
    assert found.mean.se < 0.03 * found.mean.mu
    for point in (*found.points, found.mean):
        truth = 0.4 + 0.24 * point.I / (point.I + 0.3)
        assert abs(point.mu - truth) < 2 * point.se
    assert found.I_range == (found.points[0].I, found.points[-1].I)
    assert "without a network, gives mu = 0.4" in found.sentence


def test_noise_widens_windows_and_errors(demo: Flow, seed: int) -> None:
    clean, noisy = baseline(demo), baseline(add_noise(demo, 0.05, seed))
    assert clean.window is not None
    assert noisy.window is not None
    assert noisy.window > clean.window
    assert clean.mean is not None
    assert noisy.mean is not None
    assert noisy.mean.se > clean.mean.se
    truth = 0.4 + 0.24 * noisy.mean.I / (noisy.mean.I + 0.3)
    assert abs(noisy.mean.mu - truth) < 3 * noisy.mean.se


def test_one_inertial_number_gives_one_point() -> None:
    found = baseline(chute())
    assert found.reason is None
    assert len(found.points) == 1
    point = found.points[0]
    assert point.mu == pytest.approx(TANGENT, rel=1e-5)
    assert pytest.approx(number_of(TANGENT), rel=0.02) == point.I


def test_noise_is_no_wall() -> None:
    """Stress that points the wrong way by noise alone carries nothing."""
    flow = simulate(Collapse(mu_s=0.2, mu_2=0.44, cells=64, stride=1, frames=60))
    noisy = baseline(add_noise(flow, 0.2, 2))
    assert not noisy.carried
    assert noisy.parts is not None
    assert noisy.parts["noise"] > 0.02
    assert "noise" not in (baseline(flow).parts or {})


def test_grains_in_a_silo_hang_on_its_walls_with_noise_too() -> None:
    flow = simulate(Silo(mu_s=0.35, mu_2=0.6, cells=64, stride=2, frames=40))
    for noise in (0.0, 0.05):
        assert baseline(replace(add_noise(flow, noise, 0), walls=None)).carried


def test_grains_that_walls_carry() -> None:
    """A layer that shears against gravity is carried by something else than its base."""
    flow = chute()
    found = baseline(replace(flow, u=-flow.u))
    assert found.reason is not None
    assert "side walls" in found.reason
    assert "does not apply" in str(found)


def test_flows_without_shear_or_line() -> None:
    flow = chute()
    still = baseline(replace(flow, u=np.where(np.isfinite(flow.u), 0.0, np.nan)))
    assert still.reason is not None
    assert not still.points
    none = baseline(replace(flow, surface=None))
    assert "surface line" in str(none)
