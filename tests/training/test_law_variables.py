"""The variables of the friction law: their start, and their change in a step."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

from granpinn.config import Config, Optimizer, Rheology
from granpinn.physics.laws import DEFAULT
from granpinn.training.law_variables import LawVariables
from granpinn.training.optimise import BatchOptimizer
from granpinn.training.schedule import ControlTable

WIDTHS = (3, 4, 3)


LIKE = torch.zeros(0, dtype=torch.float64)


def after_a_step(law: LawVariables, grad_theta: Tensor, rate: float) -> None:
    """One step of Adam, which in its first step moves by rate * sign(gradient)."""
    E = len(law.q)
    control = ControlTable([lambda _: 1.0] * E, Config(), torch.device("cpu"))
    control.table[0, 0] = 1
    params = torch.zeros(E, 31, dtype=torch.float64)
    settings = Optimizer(scalars_learning_rate=rate, epsilon=1e-30)
    optimizer = BatchOptimizer(params, law, WIDTHS, settings, control)
    optimizer.step(torch.zeros_like(params[:, 0]), torch.zeros_like(params), grad_theta)
    assert not control.faults()


def make(variables: Any, E: int = 1) -> LawVariables:
    settings = Rheology(variables=variables)
    return LawVariables([DEFAULT] * E, settings, [{"I0": 0.25}] * E, range(E), LIKE)


def test_every_q_is_a_friction_law() -> None:
    log, sigmoid = make("log"), make("sigmoid")
    for q in torch.randn(50, 1, 3, dtype=torch.float64) * 5:
        mu_s, mu_2, _ = log.theta_of(q)[0].tolist()
        assert 0 < mu_s < mu_2
        assert ((sigmoid.theta_of(q)[:, :2] >= 0) & (sigmoid.theta_of(q)[:, :2] <= 1)).all()


def test_the_logarithms_stay_where_a_friction_law_can_be() -> None:
    law = make("log")
    law.q.copy_(torch.tensor([-50.0, 50.0, 0.0]))
    after_a_step(law, torch.tensor([[1.0, -1.0, 0.0]], dtype=torch.float64), 1e-3)
    expected = torch.tensor([[math.log(0.01), math.log(3), 0.0]], dtype=torch.float64)
    torch.testing.assert_close(law.q, expected)
    theta = torch.tensor([[0.01, 3.01, 0.25]], dtype=torch.float64)
    torch.testing.assert_close(law.theta, theta)


def test_a_random_start_is_a_function_of_the_seed() -> None:
    start = Rheology(variables="sigmoid", random_start=True)
    draws = LawVariables([DEFAULT] * 3, start, [{}] * 3, (1, 1, 2), LIKE).theta[:, :2]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])
    assert all(0.05 <= d[0] <= d[1] <= 0.95 for d in draws)
