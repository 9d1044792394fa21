"""The momentum balance on flows with an exact stress, and the local fits behind it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from granpinn.data import Flow, Particles
from granpinn.estimates.stress import Stress, momentum_balance
from tests.inspection.chutes import SURFACE, TANGENT, chute, number_of


def stress_of(flow: Flow) -> Stress:
    found = momentum_balance(flow)
    assert isinstance(found, Stress)
    return found


@pytest.mark.parametrize("attributes", [{}, {"period_x": 9.0}, {"period_x": 9.0, "steady": 1}])
def test_bagnolds_stress(attributes: dict[str, float]) -> None:
    flow = replace(chute(), attributes=attributes)
    found = stress_of(flow)
    k = found.used
    assert k.sum() >= 20
    depth = np.broadcast_to(SURFACE - flow.y[:, None], k.shape)
    np.testing.assert_allclose(found.p[k], depth[k] / math.hypot(1, TANGENT), rtol=1e-6)
    np.testing.assert_allclose(found.shear[k] / found.normal[k], TANGENT, rtol=1e-6)
    # A quadratic fit over five cells of a profile with the power 1.5.
    np.testing.assert_allclose(found.inertial_number[k], number_of(TANGENT), rtol=0.01)


def test_an_accelerated_layer_has_less_friction() -> None:
    a = 0.05
    found = stress_of(chute(acceleration=a))
    k = found.used
    expected = TANGENT - a * math.hypot(1, TANGENT)
    np.testing.assert_allclose(found.shear[k] / found.normal[k], expected, rtol=1e-5)


def test_a_sheet_that_thins_downhill_is_pushed() -> None:
    """Below a slope h_x of grains without acceleration, d_x p = rho g h_x alone shears."""
    slope = 0.05
    flow = chute(tangent=0.0, acceleration=-0.35)  # the velocity is that of mu = 0.35
    assert flow.surface is not None
    x = flow.surface.x
    line = replace(flow.surface, y=SURFACE - slope * (x - x.min()))
    still = replace(flow, u=flow.u - (-0.35) * flow.t[:, None, None], surface=line)
    found = stress_of(still)
    middle = np.zeros_like(found.used)
    middle[:, :, 4] = True
    k = found.used & middle & (found.depth > 3)
    assert k.sum() > 5
    # To first order in the slope: the stress along the layer changes with x too.
    np.testing.assert_allclose(found.shear[k] / found.normal[k], slope, atol=0.2 * slope)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"surface": None}, "no surface line"),
        ({"t": np.array([0.5, 1.5, 2.5, 13.5, 14.5, 40.5, 41.5, 90.5])}, "even intervals of time"),
        ({"y": np.geomspace(1, 9, 40)}, "not evenly spaced along y"),
        ({"particles": Particles(*np.ones((5, 3)))}, "scattered"),
    ],
)
def test_where_it_does_not_apply(changes: dict[str, object], reason: str) -> None:
    found = momentum_balance(replace(chute(), **changes))  # type: ignore[arg-type]
    assert isinstance(found, str)
    assert reason in found
