"""Cohesion in the kernels: its limits, and grains without pressure."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch
from torch import Tensor

from .configurations import Form, problem, small

LIMITS = (0.02, 1e-3, 1e3, 1e-4)  # d, eta_min, eta_max, p_floor
FORMS: tuple[Form, ...] = ("mixed", "strong")


def loss_of(ops: ModuleType, form: Form, theta: list[float], law: str) -> Any:
    arguments = list(problem(small(form, points=40)).loss)
    arguments[1], arguments[-1] = torch.tensor(theta, dtype=torch.float64), law
    return ops.residual_loss(*arguments)


def viscosity(ops: ModuleType, rate: float, p: float, theta: list[float], law: str) -> Tensor:
    one = torch.ones(1, dtype=torch.float64)
    return ops.viscosity(rate * one, p * one, torch.tensor(theta).double(), *LIMITS, law)[0]


@pytest.mark.parametrize("form", FORMS)
def test_without_cohesion_the_law_is_mu_of_i(form: Form, ops: ModuleType) -> None:
    found = loss_of(ops, form, [0.4, 0.6, 0.3, 0.0], "cohesive")
    expected = loss_of(ops, form, [0.4, 0.6, 0.3], "mu_of_i")
    for a, b in zip(found[:3], expected[:3], strict=True):
        torch.testing.assert_close(a, b, rtol=1e-12, atol=0)
    torch.testing.assert_close(found[3][:3], expected[3], rtol=1e-11, atol=0)
    assert found[3][3] != 0


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
def test_the_residual_is_finite_without_pressure(z: float, ops: ModuleType) -> None:
    """There, r = -w 2 D: the softplus of z is 0 in float32, and |s| = mu + c/p has no value."""
    case = problem(small("mixed", points=40)).to(torch.float32)
    params = case.params.clone()
    params[-3] = z  # bias of the output from which the pressure is made
    arguments = list(case.loss)
    arguments[0], arguments[-1] = params, "cohesive"
    arguments[1] = torch.tensor([0.4, 0.6, 0.3, 0.1])
    loss, terms, by_params, by_theta = ops.residual_loss(*arguments)
    for result in (loss, terms, by_params, by_theta):
        assert result.isfinite().all()
    arguments[1] = torch.tensor([0.4, 0.6, 0.3, 0.2])
    torch.testing.assert_close(ops.residual_loss(*arguments)[1], terms, rtol=1e-4, atol=0)
