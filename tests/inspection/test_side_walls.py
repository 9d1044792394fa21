"""The momentum balance with the friction of side walls, on a layer with a known stress."""

from __future__ import annotations

import numpy as np
import pytest

from granpinn.config import SideWalls
from granpinn.data import Flow
from granpinn.estimates.stress import Stress, momentum_balance
from granpinn.inspection.momentum_balance import baseline
from tests.flows import make_channel

GAP, FRICTION = 24.0, 0.3


def stress_of(flow: Flow, friction: float) -> Stress:
    found = momentum_balance(flow, 2, 0.3, friction)
    assert isinstance(found, Stress)
    assert found.used.sum() >= 20
    return found


def test_the_walls_carry_a_part_of_the_shear_stress() -> None:
    """mu = tan - mu_w z / W; s weakens the friction by 0.5 % where the speed is 0.1 of its rms."""
    found = stress_of(make_channel(gap=GAP, friction=FRICTION), FRICTION)
    k = found.used
    depth, into = found.depth[k], 1 / np.hypot(0.5, 1)
    np.testing.assert_allclose(found.p[k], into * depth, rtol=1e-6)
    np.testing.assert_allclose(
        found.shear[k] / found.normal[k], 0.5 - FRICTION * depth / GAP, rtol=2e-3
    )


def test_the_law_and_its_error_from_the_walls() -> None:
    """The sd of mu_w counts: a known friction has smaller errors than an unknown one."""
    flow = make_channel(gap=GAP, friction=FRICTION, rows=240)
    known, unknown = (baseline(flow, side_walls=SideWalls(FRICTION, sd)) for sd in (0.0, 0.1))
    assert known.law is not None
    assert known.law.mu_s == pytest.approx(0.3, abs=0.005)
    assert known.law.mu_2 == pytest.approx(0.7, abs=0.02)
    assert known.parts is not None
    assert unknown.parts is not None
    assert known.parts["side_walls"] == 0
    # at the mean I, z is that of mu = tan - mu_w z / W; without walls the friction is tan there
    assert unknown.mean is not None
    share = (0.5 - unknown.mean.mu) / FRICTION * 0.1 / unknown.mean.mu
    assert unknown.parts["side_walls"] == pytest.approx(share, rel=0.1)
    assert known.mean is not None
    assert unknown.mean.se == pytest.approx(np.hypot(known.mean.se, share * known.mean.mu), rel=0.1)
    assert "with the friction 0.3 of the side walls" in known.sentence
    assert "side walls" in str(known)
    smooth = baseline(flow, side_walls=SideWalls(0.0, 0.0))
    assert smooth.mean is not None
    assert smooth.mean.mu == pytest.approx(0.5, rel=1e-5)
