"""The loss around a trained network: it is that of all unknowns, with the last layer eliminated."""

from __future__ import annotations

import pytest
import torch

from granpinn.kernels.network import initial_parameters
from granpinn.physics.laws import LAWS
from granpinn.physics.laws.free import WITH_COHESION
from granpinn.training.elimination import RIDGE
from granpinn.training.features import Features, coefficients
from granpinn.training.information import BOXES, information
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.objective import Member

from .test_last_layer import SPEC, draw, problem

CURVE = torch.linspace(0.35, 0.6, 8, dtype=torch.float64)
FREE = torch.cat([CURVE, torch.tensor([0.005, 0.5], dtype=torch.float64)])
COHESIVE = torch.tensor([0.4, 0.64, 0.3, 0.02], dtype=torch.float64)


def member(law: str, seed: int) -> Member:
    values = {"I0": 0.3} if law == "cohesive" else {"I_low": 0.005, "I_high": 0.5}
    return Member(problem(), draw(seed), seed, LAWS[law], values)


@pytest.mark.parametrize("law", ["free", "cohesive"])
def test_the_sums_over_boxes_are_the_schur_complement(law: str, seed: int) -> None:
    params, own = initial_parameters(SPEC, seed), member(law, seed)
    theta = FREE if law == "free" else COHESIVE
    found = information(own, params, theta, 0)
    assert found is not None
    full = torch.cat([theta, theta.new_zeros(1)]) if law == "free" else theta
    features = Features(SPEC, params)
    data = choose(own.data, features, seed, 0)
    used = WITH_COHESION if law == "free" else own.law
    sums = Sums(features, own.problem, used, data)
    at = Unknowns(coefficients(SPEC, params), full)
    sums.loss(at)
    with torch.enable_grad():
        A, b = sums.normal_equations(at)
    L = len(sums.free)
    A_cc = A[:-L, :-L].clone()
    A_cc.diagonal().mul_(1 + RIDGE)
    solved = torch.linalg.solve(A_cc, torch.cat([b[:-L, None], A[:-L, -L:]], 1))
    H = A[-L:, -L:] - A[-L:, :-L] @ solved[:, 1:]
    g = b[-L:] - A[-L:, :-L] @ solved[:, 0]
    # the ridge keeps both from being equal to the last digits
    scale = float(H.abs().max())
    torch.testing.assert_close(found.information.sum(0), H, rtol=1e-3, atol=1e-5 * scale)
    torch.testing.assert_close(found.scores.sum(0), g, rtol=1e-3, atol=1e-5 * float(g.abs().max()))
    assert found.scores.shape == (BOXES**3, L)
    torch.testing.assert_close(found.free, full[sums.free])


def test_a_free_curve_has_a_prior_and_a_cohesion_of_zero(seed: int) -> None:
    params, own = initial_parameters(SPEC, seed), member("free", seed)
    found = information(own, params, FREE, 0)
    assert found is not None
    assert found.free[-1] == 0
    assert float(found.prior[-1].abs().max()) == 0  # no prior of the cohesion
    straight = torch.cat([torch.arange(8.0).double(), torch.zeros(1).double()])
    assert float((found.prior @ straight).abs().max()) <= 1e-9 * float(found.prior.abs().max())
