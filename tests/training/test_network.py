"""The flat parameter vector: its layout, its start, and the scalars of the friction law."""

from __future__ import annotations

import math

import pytest
import torch

from granpinn import ops
from granpinn.config import Rheology
from granpinn.network import NetworkSpec, initial_parameters, n_params, views
from granpinn.scalars import Scalars

SPEC = NetworkSpec((3, 40, 50, 5), (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), "mixed")


def test_views_are_the_layout_of_the_kernels() -> None:
    params = initial_parameters(SPEC, seed=1)
    points = torch.rand(7, 3, dtype=torch.float64)
    a = (points - torch.tensor(SPEC.input_shift)) * torch.tensor(SPEC.input_scale)
    for layer, (W, b) in enumerate(views(params, SPEC.widths)):
        a = (a if layer == 0 else a * torch.sigmoid(a)) @ W.T + b
    z = ops.network_value(points, params, SPEC.widths, SPEC.input_shift, SPEC.input_scale)
    torch.testing.assert_close(z, a, rtol=1e-6, atol=1e-7)


def test_views_share_memory_and_cover_everything() -> None:
    params = torch.zeros(SPEC.n_params)
    for W, b in views(params, SPEC.widths):
        W += 1
        b += 1
    assert (params == 1).all()
    assert SPEC.n_params == n_params(SPEC.widths) == 40 * 4 + 50 * 41 + 5 * 51


def test_views_refuse_another_length() -> None:
    with pytest.raises(ValueError, match=r"params must be \[2465\].*got \[3\]"):
        views(torch.zeros(3), SPEC.widths)


@pytest.mark.parametrize("widths", [(3,), (2, 8, 5), (3, 8, 3)])
def test_a_spec_refuses_widths_that_do_not_fit_the_form(widths: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="widths must be 3, hidden widths, 5 for the mixed form"):
        NetworkSpec(widths, (0, 0, 0), (1, 1, 1), "mixed")


@pytest.mark.parametrize("distribution", ["wide", "glorot_uniform"])
def test_the_start_is_a_function_of_the_seed(distribution: str) -> None:
    first = initial_parameters(SPEC, 3, distribution)
    torch.rand(5)
    assert torch.equal(first, initial_parameters(SPEC, 3, distribution))
    assert not torch.equal(first, initial_parameters(SPEC, 4, distribution))


def test_the_start_has_the_spread_that_it_says() -> None:
    (W_0, b_0), (W_1, b_1), (W_2, b_2) = views(initial_parameters(SPEC, 0), SPEC.widths)
    assert W_0.std() == pytest.approx(1, rel=0.2)
    assert b_0.abs().max() <= 1
    assert W_1.std() == pytest.approx(1.4 / math.sqrt(40), rel=0.1)
    assert W_2[:2].std() == pytest.approx(1 / math.sqrt(50), rel=0.3)
    assert W_2[2:].std() == pytest.approx(0.3 / math.sqrt(50), rel=0.3)
    assert not b_1.any()
    assert not b_2.any()
    for W, b in views(initial_parameters(SPEC, 0, "glorot_uniform"), SPEC.widths):
        assert W.std() == pytest.approx(math.sqrt(2 / sum(W.shape)), rel=0.2)
        assert not b.any()


@pytest.mark.parametrize("variables", ["log", "sigmoid"])
def test_scalars_start_where_they_should_and_pull_gradients_back(variables: str) -> None:
    like = torch.zeros(0, dtype=torch.float64)
    scalars = Scalars(Rheology(variables=variables, mu_s=0.3, mu_2=0.7), 0.25, 0, like)  # type: ignore[arg-type]
    expected = torch.tensor([0.3, 0.7, 0.25], dtype=torch.float64)
    torch.testing.assert_close(scalars.theta(), expected)

    q = scalars.values.clone().requires_grad_()
    weights = torch.tensor([2.0, -3.0, 5.0], dtype=torch.float64)
    (weights * scalars.theta(q)).sum().backward()
    torch.testing.assert_close(scalars.pull_back(weights), q.grad)


def test_every_q_is_a_friction_law() -> None:
    like = torch.zeros(0, dtype=torch.float64)
    log = Scalars(Rheology(), 0.3, 0, like)
    sigmoid = Scalars(Rheology(variables="sigmoid"), 0.3, 0, like)
    for q in torch.randn(50, 2, dtype=torch.float64) * 5:
        mu_s, mu_2, _ = log.theta(q).tolist()
        assert 0 < mu_s < mu_2
        assert ((sigmoid.theta(q)[:2] >= 0) & (sigmoid.theta(q)[:2] <= 1)).all()


def test_the_logarithms_stay_where_a_friction_law_can_be() -> None:
    scalars = Scalars(Rheology(), 0.3, 0, torch.zeros(0, dtype=torch.float64))
    scalars.values.copy_(torch.tensor([-50.0, 50.0]))
    scalars.confine()
    expected = torch.tensor([0.01, 3.01, 0.3], dtype=torch.float64)
    torch.testing.assert_close(scalars.theta(), expected)


def test_a_random_start_is_a_function_of_the_seed() -> None:
    start = Rheology(variables="sigmoid", mu_s=None, mu_2=None)
    like = torch.zeros(0)
    draws = [Scalars(start, 0.3, seed, like).theta()[:2] for seed in (1, 1, 2)]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])
    assert all(0.05 <= d[0] <= d[1] <= 0.95 for d in draws)
