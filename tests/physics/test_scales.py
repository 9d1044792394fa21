"""Scales: their values for a known column, and the exact inverse of every conversion."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from granpinn.data.scaling import inertial_diameter, scales_of
from granpinn.physics.scales import Quantity, Scales
from tests.flows import make_flow

FLOW = make_flow()
SCALES = scales_of(FLOW)
QUANTITIES = get_args(Quantity)
positive = st.floats(1e-6, 1e6)
# Far from the smallest doubles, which have fewer digits.
number = st.just(0.0) | positive | positive.map(lambda value: -value)


def test_of_a_known_column() -> None:
    """Grains fill the rows from 0 to 21 of 24 in the first frame: 21 cells of 1.1/24 m."""
    rows = np.flatnonzero(FLOW.material[0].any(axis=1))
    assert (rows[0], rows[-1]) == (0, 20)
    h0 = 21 * 1.1 / 24
    assert SCALES.length == pytest.approx(h0, rel=1e-12)
    assert SCALES.velocity == pytest.approx(math.sqrt(9.81 * h0), rel=1e-12)
    assert SCALES.time == pytest.approx(math.sqrt(h0 / 9.81), rel=1e-12)
    assert SCALES.pressure == pytest.approx(1500 * 9.81 * h0, rel=1e-12)


def test_units_are_consistent() -> None:
    """P = rho U^2, L = U T, and with them the dimensionless momentum equation has no factors."""
    s = SCALES
    assert s.pressure == pytest.approx(FLOW.density * s.velocity**2, rel=1e-12)
    assert s.length == pytest.approx(s.velocity * s.time, rel=1e-12)
    assert s.unit("acceleration") == pytest.approx(math.hypot(*FLOW.gravity), rel=1e-12)
    assert s.unit("viscosity") == pytest.approx(FLOW.density * s.velocity * s.length, rel=1e-12)
    assert s.unit("rate") * s.time == pytest.approx(1, rel=1e-12)


@settings(deadline=None)
@given(positive, positive, positive, positive, number, st.sampled_from(QUANTITIES))
def test_round_trip(
    length: float, velocity: float, time: float, pressure: float, value: float, quantity: Quantity
) -> None:
    scales = Scales(length, velocity, time, pressure)
    there = scales.to_dimensionless(value, quantity)
    assert scales.to_physical(there, quantity) == pytest.approx(value, rel=1e-12, abs=0)
    values = np.array([value, np.nan])
    back = scales.to_physical(scales.to_dimensionless(values, quantity), quantity)
    np.testing.assert_allclose(back, values, rtol=1e-12)
    tensor = torch.tensor([value], dtype=torch.float64)
    torch.testing.assert_close(
        scales.to_dimensionless(scales.to_physical(tensor, quantity), quantity),
        tensor,
        rtol=1e-12,
        atol=0,
    )


@settings(deadline=None)
@given(st.lists(st.tuples(number, number, number), min_size=1, max_size=9))
def test_round_trip_of_points(points: list[tuple[float, float, float]]) -> None:
    x, y, t = np.array(points).T
    there = SCALES.points_to_dimensionless(x, y, t)
    np.testing.assert_allclose(there[:, 2], t / SCALES.time, rtol=1e-12)
    np.testing.assert_allclose(SCALES.points_to_physical(there), points, rtol=1e-12)


def test_units_of_the_file_do_not_matter() -> None:
    """The same flow in millimeters and milliseconds has the same dimensionless numbers."""
    surface = FLOW.surface
    assert surface is not None
    small = replace(
        FLOW,
        t=FLOW.t * 1e3,
        x=FLOW.x * 1e3,
        y=FLOW.y * 1e3,
        gravity=(0.0, -9.81e-3),
        grain_diameter=FLOW.grain_diameter * 1e3,
        eta_max=None,
        eta_min=None,
    )
    scales = scales_of(small)
    np.testing.assert_allclose(
        scales.points_to_dimensionless(small.x[:9], small.y[:9], small.t[:9]),
        SCALES.points_to_dimensionless(FLOW.x[:9], FLOW.y[:9], FLOW.t[:9]),
        rtol=1e-12,
    )
    assert inertial_diameter(small, scales) == pytest.approx(
        inertial_diameter(FLOW, SCALES), rel=1e-12
    )
    assert scales.velocity == pytest.approx(SCALES.velocity, rel=1e-12)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["length", "velocity", "time", "pressure"])
def test_refuses_scales_that_are_no_scales(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"scale of {name} must be positive and finite"):
        replace(SCALES, **{name: value})
