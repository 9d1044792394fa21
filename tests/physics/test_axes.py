"""The axes of the training: gravity down, vectors and stresses there and back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from granpinn.data.scaling import RESOLUTION, scales_of
from granpinn.physics.axes import Axes
from granpinn.training.points import training_set
from tests.flows import make_flow


def gravity(angle: float, size: float = 9.81) -> tuple[float, float]:
    return size * math.sin(angle), -size * math.cos(angle)


@pytest.mark.parametrize("degrees", [-9.9, -1.2, 0.01, 3.0, 9.9])
def test_gravity_is_turned_downwards(degrees: float) -> None:
    g = gravity(math.radians(degrees))
    axes = Axes.of(g)
    assert axes.gravity == (0.0, -1.0)
    assert axes.turn(*g) == pytest.approx((0.0, -9.81), abs=1e-14)
    assert axes.undo(0.0, -9.81) == pytest.approx(g, abs=1e-14)


def test_stress_is_turned_back_as_a_tensor() -> None:
    axes = Axes.of(gravity(math.radians(6)))
    R = np.array([axes.turn(1.0, 0.0), axes.turn(0.0, 1.0)]).T
    np.testing.assert_allclose(R @ R.T, np.eye(2), atol=1e-15)
    sigma = np.array([[0.3, -0.7], [-0.7, -0.3]])
    expected = R.T @ sigma @ R
    found = axes.undo_stress(sigma[0, 0], sigma[0, 1])
    np.testing.assert_allclose(found, expected[0], rtol=1e-14)


def test_a_training_set_is_upright_and_rounded() -> None:
    """To 2^-24 in dimensionless units: turned by hand, all its numbers agree to half of that."""
    flow = replace(make_flow(), gravity=gravity(math.radians(4)))
    scales = scales_of(flow)
    found = training_set(flow, scales, "V1", torch.float64)
    k, row, column = (int(i[7]) for i in np.nonzero(flow.valid & (flow.t > 0)[:, None, None]))
    cos, sin = math.cos(math.radians(4)), math.sin(math.radians(4))
    for values, (x, y), unit in (
        (found.points, (flow.x[column], flow.y[row]), scales.length),
        (found.velocity, (flow.u[k, row, column], flow.v[k, row, column]), scales.velocity),
    ):
        expected = [(cos * x + sin * y) / unit, (cos * y - sin * x) / unit]
        np.testing.assert_allclose(values[7, :2], expected, rtol=0, atol=0.5001 * RESOLUTION)
    for values in (found.points, found.velocity, found.surface_points):
        assert torch.equal(values, torch.round(values / RESOLUTION) * RESOLUTION)
