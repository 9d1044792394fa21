"""The scalars of the friction law: their start, and what a step does to them."""

from __future__ import annotations

import math
from typing import Any

import pytest
import torch
from granpinn.training.control import Control
from granpinn.training.scalars import Scalars
from torch import Tensor

from granpinn.config import Optimizer, Rheology
from granpinn.training.optimise import BatchOptimizer

WIDTHS = (3, 4, 3)
LIKE = torch.zeros(0, dtype=torch.float64)


def after_a_step(scalars: Scalars, grad_theta: Tensor, rate: float) -> None:
    """One step of Adam, which in its first step moves by rate * sign(gradient)."""
    E = len(scalars.values)
    control = Control(E, torch.device("cpu"))
    control.table[0, 0] = 1
    params = torch.zeros(E, 31, dtype=torch.float64)
    settings = Optimizer(scalars_learning_rate=rate, epsilon=1e-30)
    optimizer = BatchOptimizer(params, scalars, WIDTHS, settings, control)
    optimizer.step(torch.zeros_like(params[:, 0]), torch.zeros_like(params), grad_theta)
    assert not control.faults()


def make(variables: Any, E: int = 1, **start: Any) -> Scalars:
    return Scalars(Rheology(variables=variables, **start), [0.25] * E, range(E), LIKE)


@pytest.mark.parametrize("variables", ["log", "sigmoid"])
def test_they_start_where_they_should(variables: str) -> None:
    expected = torch.tensor([[0.3, 0.7, 0.25]] * 2, dtype=torch.float64)
    torch.testing.assert_close(make(variables, 2, mu_s=0.3, mu_2=0.7).theta, expected)


@pytest.mark.parametrize("variables", ["log", "sigmoid"])
def test_gradients_are_pulled_back_to_them(variables: str) -> None:
    """The first moment after one step is (1 - beta_1) d loss / d q."""
    scalars = make(variables, 2, mu_s=0.3, mu_2=0.7)
    q = scalars.values.clone().requires_grad_()
    weights = torch.tensor([[2.0, -3.0, 5.0], [-1.0, 0.5, 1.0]], dtype=torch.float64)
    (weights * scalars.law(q)).sum().backward()
    assert q.grad is not None
    rate = 1e-3
    before = scalars.values.clone()
    after_a_step(scalars, weights, rate)
    torch.testing.assert_close(scalars.values, before - rate * q.grad.sign())
    torch.testing.assert_close(scalars.theta, scalars.law(scalars.values))


def test_every_q_is_a_friction_law() -> None:
    log, sigmoid = make("log"), make("sigmoid")
    for q in torch.randn(50, 1, 2, dtype=torch.float64) * 5:
        mu_s, mu_2, _ = log.law(q)[0].tolist()
        assert 0 < mu_s < mu_2
        assert ((sigmoid.law(q)[:, :2] >= 0) & (sigmoid.law(q)[:, :2] <= 1)).all()


def test_the_logarithms_stay_where_a_friction_law_can_be() -> None:
    scalars = make("log")
    scalars.values.copy_(torch.tensor([-50.0, 50.0]))
    after_a_step(scalars, torch.tensor([[1.0, -1.0, 0.0]], dtype=torch.float64), 1e-3)
    expected = torch.tensor([[math.log(0.01), math.log(3)]], dtype=torch.float64)
    torch.testing.assert_close(scalars.values, expected)
    law = torch.tensor([[0.01, 3.01, 0.25]], dtype=torch.float64)
    torch.testing.assert_close(scalars.theta, law)


def test_a_random_start_is_a_function_of_the_seed() -> None:
    start = Rheology(variables="sigmoid", mu_s=None, mu_2=None)
    draws = Scalars(start, [0.3] * 3, (1, 1, 2), LIKE).theta[:, :2]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])
    assert all(0.05 <= d[0] <= d[1] <= 0.95 for d in draws)
