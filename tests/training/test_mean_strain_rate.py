"""The mean strain rate of the law in the last-layer step: its points, its length, the floor."""

from __future__ import annotations

import dataclasses
import math
from itertools import product

import pytest
import torch

from granpinn.kernels.network import initial_parameters
from granpinn.physics.laws import DEFAULT
from granpinn.training.equations import residuals
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer_sums import Unknowns
from tests.training.test_last_layer import PHYSICS, SPEC, THETA, draw, problem, sums_of


def test_means_are_those_of_four_points(seed: int) -> None:
    """And to second order D + L^2/4 (D_xx + D_yy)."""
    features, data = Features(SPEC, initial_parameters(SPEC, seed)), draw(seed, points=40)
    h = features.with_means(data.points, 0.04)
    torch.testing.assert_close(h[:4], features.jet(data.points), rtol=0, atol=0)
    nine = torch.zeros_like(h[4:])
    for i, j in product((-1, 0, 1), repeat=2):
        shift = h.new_tensor([0.04 * i, 0.04 * j, 0])
        nine += features.jet(data.points + shift)[1:3] * (2 - abs(i)) * (2 - abs(j)) / 16
    curved = float((nine - h[1:3]).abs().max())
    assert float((h[4:] - nine).abs().max()) < 0.05 * curved
    still = features.with_means(data.points, 0.0)
    torch.testing.assert_close(still[4:], still[1:3], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(("mu_s", "ill_posed"), [(0.2, False), (0.6, True)])
def test_the_law_sees_the_mean_where_it_is_ill_posed(mu_s: float, ill_posed: bool) -> None:
    """A shear rate of 0.1 with a mean of 0.06, stress ratio 0.5: the residual is known."""
    z = torch.zeros(6, 1, 5, dtype=torch.float64)
    U, P = PHYSICS.velocity_scale, PHYSICS.pressure_scale
    z[0, 0, 2], z[0, 0, 4] = 0.3, 0.5
    z[2, 0, 0], z[5, 0, 0] = 0.1 / U, 0.06 / U
    theta = THETA.new_tensor([[mu_s, mu_s + 0.24, 0.3]])
    e, _ = residuals(z, theta, PHYSICS._replace(law_rate=math.inf), DEFAULT)
    rate = 0.06 if ill_posed else 0.1
    inertial = PHYSICS.grain_diameter * rate / math.sqrt(P * math.log1p(math.exp(0.3)))
    mu = mu_s + 0.24 * inertial / (0.3 + inertial)
    assert float(e[0, 4]) == pytest.approx(rate * 0.5 / mu - 0.1, rel=1e-9)


def test_the_law_does_not_count_at_the_floor(seed: int) -> None:
    """There the mean would be one over points without data."""
    params, data = initial_parameters(SPEC, seed), draw(seed)
    reach = float(data.lower[1]) + 0.2
    posed = dataclasses.replace(problem(1e-30, 1e-30, 1e-30, 1e-30, 1), mean_length=0.2)
    at = Unknowns(coefficients(SPEC, params), THETA)
    everywhere = sums_of(posed, data, params).loss(at)
    high = data.points[:, 1] >= reach
    assert 0 < int(high.sum()) < len(high)
    one = torch.where(high, 1.0, 7.0)[:, None].double()
    moved = dataclasses.replace(data, point_weights=data.point_weights * one)
    assert sums_of(posed, moved, params).loss(at) == pytest.approx(everywhere, rel=1e-12)
