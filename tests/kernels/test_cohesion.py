"""Cohesion in the kernels: its limits, and grains without pressure."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch
from torch import Tensor

from granpinn.kernels.network import views

from .configurations import Problem, problem, small

LIMITS = (0.02, 1e-3, 1e3, 1e-4)  # d, eta_min, eta_max, p_floor


def loss_at(ops: ModuleType, case: Problem, theta: list[float], law: str) -> Any:
    return ops.residual_loss(*case._replace(theta=case.params.new_tensor(theta), law=law))


def viscosity(ops: ModuleType, rate: float, p: float, theta: list[float], law: str) -> Tensor:
    one = torch.ones(1, dtype=torch.float64)
    return ops.viscosity(rate * one, p * one, torch.tensor(theta).double(), *LIMITS, law)[0]


def test_cohesion_shifts_the_pressure_of_constant_friction(ops: ModuleType) -> None:
    """c + mu p = mu (p + c / mu)."""
    for p in (0.0, 1e-3, 0.7):
        found = viscosity(ops, 0.5, p, [0.4, 0.4, 0.3, 0.1], "cohesive")
        expected = viscosity(ops, 0.5, p + 0.1 / 0.4, [0.4], "coulomb")
        torch.testing.assert_close(found, expected, rtol=1e-14, atol=0)


@pytest.mark.parametrize(("p", "c", "eta"), [(0.0, 0.1, 1e3), (-0.1, 0.1, 1e3), (-1, 0.1, 1e-3)])
def test_cohesive_grains_at_rest(p: float, c: float, eta: float, ops: ModuleType) -> None:
    """They hold a stress without pressure, and under tension up to c / mu."""
    assert viscosity(ops, 0.0, p, [0.4, 0.6, 0.3, c], "cohesive") == eta


@pytest.mark.parametrize("z", [-30.0, -120.0, -1e4])
def test_the_residual_without_pressure(z: float, ops: ModuleType) -> None:
    """With p = 0, p / Y = 0: r = -w 2 D at any friction and any c, though |s| has no bound."""
    case = problem(small("mixed", points=40)).to(torch.float32)
    W, b = views(case.params, case.spec.widths)[-1]
    W[2], b[2] = 0, z  # of the output from which the pressure is made
    expected = loss_at(ops, case, [0.4, 0.6, 0.3, 0.1], "cohesive")
    for result in expected:
        assert result.isfinite().all()
    found = loss_at(ops, case, [0.5, 0.7, 0.3, 0.2], "cohesive")
    assert expected[1][4] > 0
    torch.testing.assert_close(found[1][4], expected[1][4], rtol=1e-5, atol=0)
