"""Members that have one law: their theta stays equal bit for bit, and both flows decide it."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch
from torch import Tensor

from granpinn.config import Config
from granpinn.data import Flow
from granpinn.training.elimination import RIDGE, solve_group
from granpinn.training.objective import Member, Objective
from granpinn.training.schedule import Schedule
from granpinn.training.trainer import Trainer
from tests.flows import make_flow
from tests.runs import make_objective, tiny

OTHER = make_flow(frames=9, columns=16, grain_diameter=0.04)


def trainer_of(config: Config, *members: Member) -> Trainer:
    assert config.steps is not None
    objective = Objective(members, config.batch, torch.device("cpu"), precision=config.precision)
    return Trainer(objective, Schedule(config.steps, config.optimizer), config)


def trained(config: Config, *members: Member) -> Trainer:
    trainer = trainer_of(config, *members)
    while not trainer.finished:
        trainer.advance()
        assert all(
            torch.equal(trainer.law_variables.theta[e], trainer.law_variables.theta[group[0]])
            for group in trainer.objective.groups
            for e in group
        )
    trainer.solve_last_layer()
    return trainer


def member(config: Config, flow: Flow, group: int | None = None, seed: int = 0) -> Member:
    made = make_objective(config, flow).members[0]
    return dataclasses.replace(made, group=group, seed=seed)


def theta(trainer: Trainer, e: int) -> Tensor:
    return trainer.solution(e)[1]


@pytest.fixture(autouse=True)
def long_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """For networks that are hardly trained."""
    monkeypatch.setattr("granpinn.training.last_layer.LONGEST", 3)


def test_theta_is_equal_in_a_group_and_groups_are_separate(flow: Flow) -> None:
    config = tiny()
    four = [member(config, f, group, seed=group) for group in (1, 2) for f in (flow, OTHER)]
    found = trained(config, *four)
    assert found.objective.groups == [[0, 1], [2, 3]]
    assert torch.equal(theta(found, 0), theta(found, 1))
    assert torch.equal(theta(found, 2), theta(found, 3))
    assert not torch.equal(theta(found, 0), theta(found, 2))
    two = trained(config, *four[:2])
    assert torch.equal(theta(two, 0), theta(found, 0))  # another group has no influence
    assert not torch.equal(found.params[0], found.params[1])


def test_the_gradient_of_the_law_is_that_of_the_likelihood_of_the_group(flow: Flow) -> None:
    config = tiny()
    trainer = trainer_of(
        config, member(config, flow, 0), member(config, OTHER), member(config, OTHER, 0)
    )
    grad = torch.tensor([[1.0, 2.0, 0.0], [math.nan, 5.0, 0.0], [10.0, 20.0, 0.0]])
    expected = torch.tensor([[3.5, 7.0, 0.0], [math.nan, 5.0, 0.0], [3.5, 7.0, 0.0]])
    found = trainer.objective.over_groups(grad, torch.tensor([1.0, 3.0, 4.0]))
    torch.testing.assert_close(found, expected, rtol=0, atol=0, equal_nan=True)


def test_a_group_is_rolled_back_and_given_up_as_a_whole(flow: Flow) -> None:
    config = tiny()
    trainer = trainer_of(
        config, member(config, flow, 0), member(config, OTHER), member(config, OTHER, 0)
    )
    start = trainer.law_variables.theta.clone()
    trainer.law_variables.theta += 1
    trainer.roll_back([2])
    assert trainer.lr_scale == [0.5, 1.0, 0.5]
    assert (trainer.law_variables.theta - start).any(1).tolist() == [False, True, False]
    trainer.give_up({0: "why"})
    assert trainer.diverged == {0: "why", 2: "why"}


def test_the_steps_of_a_group_solve_the_equations_of_all_unknowns(seed: int) -> None:
    """Against one dense matrix over (C of both, theta)."""
    g = torch.Generator().manual_seed(seed)
    n, L = 7, 2
    equations = []
    dense = torch.zeros(2 * n + L, 2 * n + L, dtype=torch.float64)
    right = torch.zeros(2 * n + L, dtype=torch.float64)
    for f in range(2):
        J = torch.randn(40, n + L, generator=g, dtype=torch.float64)
        A, b = J.T @ J, J.T @ torch.randn(40, generator=g, dtype=torch.float64)
        equations.append((A, b))
        i = torch.tensor([*range(f * n, (f + 1) * n), 2 * n, 2 * n + 1])
        own = A.clone()
        own.diagonal()[:n] *= 1 + RIDGE
        dense[i[:, None], i] += own
        right[i] += b
    expected = torch.linalg.solve(dense, -right)
    steps = solve_group(equations, L)
    assert steps is not None
    for f, step in enumerate(steps):
        torch.testing.assert_close(step[:n], expected[f * n : (f + 1) * n], rtol=1e-9, atol=1e-12)
        torch.testing.assert_close(step[n:], expected[2 * n :], rtol=1e-9, atol=1e-12)
    assert solve_group([(A, b), (-A, b)], L) is None
