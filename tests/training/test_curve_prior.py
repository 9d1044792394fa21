"""The strength of the prior of a free curve, from synthetic normal equations."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from granpinn.kernels.network import initial_parameters
from granpinn.physics.laws import LAWS
from granpinn.training import curve_prior
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer import LONGEST, improve
from granpinn.training.last_layer_sums import Sums, Unknowns
from granpinn.training.law_variables import relative_change

from .test_last_layer import SPEC, draw, every_point, problem

BLOCKS, EACH = 50, 40  # of residuals


def second_differences(L: int) -> Tensor:
    D = torch.zeros(L - 2, L, dtype=torch.float64)
    for k, row in enumerate(D):
        row[k : k + 3] = torch.tensor([1.0, -2.0, 1.0])
    return D


def equations(
    rng: torch.Generator, L: int, roughness: float, noise: float, copies: int = 1
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Normal equations at theta = 0 of a random linear fit of three other unknowns and a curve.

    The second differences of the true curve have the sd `roughness`. Every residual comes `copies`
    times.
    """
    J = torch.randn(BLOCKS * EACH, 3 + L, generator=rng, dtype=torch.float64)
    steps = roughness * torch.randn(L - 2, generator=rng, dtype=torch.float64)
    curve = torch.cat([torch.zeros(2, dtype=torch.float64), steps.cumsum(0).cumsum(0)])
    other = torch.randn(3, generator=rng, dtype=torch.float64)
    r = noise * torch.randn(len(J), generator=rng, dtype=torch.float64)
    r = r - J @ torch.cat([other, curve])
    fit = torch.linalg.lstsq(J, -r[:, None]).solution[:, 0]
    rest = r + J @ fit  # residuals at the best fit; the step from 0 is known
    J, rest = J.repeat(copies, 1), rest.repeat(copies)
    scores = (J * rest[:, None]).view(copies, BLOCKS, EACH, -1).sum((0, 2))
    return J.T @ J, -(J.T @ J) @ fit, scores, curve


@pytest.mark.parametrize("copies", [1, 20])
@pytest.mark.parametrize("roughness", [0.01, 0.3])
def test_the_strength_is_that_of_the_true_curves(roughness: float, copies: int, seed: int) -> None:
    """sigma^2 lambda in the mean of many long curves; copies of residuals add no information."""
    rng, noise, L = torch.Generator().manual_seed(seed), 0.1, 40
    D, found = second_differences(L), []
    for _ in range(20):
        A, b, scores, _ = equations(rng, L, roughness, noise, copies)
        weight = curve_prior.strength(A, b, scores, torch.zeros(L).double(), D, 1e-12)
        found.append(math.log(weight))
    expected = math.log(copies * noise**2 / roughness**2)
    assert sum(found) / len(found) == pytest.approx(expected, abs=0.3)


def test_the_scores_of_the_blocks_add_up_to_the_gradient(seed: int) -> None:
    """And with the prior, a step of a free curve lowers the loss with the prior in it."""
    params, data = initial_parameters(SPEC, seed), draw(seed)
    features = Features(SPEC, params)
    law = LAWS["free"]
    theta = torch.tensor([p.typical for p in law.parameters], dtype=torch.float64)
    theta[:8] += 0.1 * torch.randn(8, generator=torch.Generator().manual_seed(seed))
    at = Unknowns(coefficients(SPEC, params), theta)
    sums = Sums(features, problem(), law, every_point(data, features))
    loss = sums.loss(at)
    A, b = sums.normal_equations(at)
    torch.testing.assert_close(sums.scores(at).sum(0), b, rtol=1e-9, atol=1e-12)
    prior = sums.expect_smooth(A, b, at)
    assert prior > 0
    assert sums.loss(at) == pytest.approx(loss + prior, rel=1e-12)
    after = improve(sums, at)
    assert sums.loss(after) <= sums.loss(at)
    assert relative_change(law, at.theta, after.theta) <= LONGEST
