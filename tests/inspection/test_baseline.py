"""The baseline: points, standard errors, and the reasons for its absence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow
from granpinn.inspection.momentum_balance import baseline
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
    assert found.law is not None
    assert found.law.mu_s == pytest.approx(0.4, abs=2 * found.law.mu_s_sd)
    assert found.I_range == (found.points[0].I, found.points[-1].I)
    assert "without a network, gives mu = 0.4" in found.sentence


def test_one_inertial_number_gives_one_point() -> None:
    found = baseline(chute())
    assert found.reason is None
    assert len(found.points) == 1
    assert found.law is None
    point = found.points[0]
    assert point.mu == pytest.approx(TANGENT, rel=1e-5)
    assert pytest.approx(number_of(TANGENT), rel=0.02) == point.I


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
