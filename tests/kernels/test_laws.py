"""The laws in Python, in C++ and in the oracle are the same ones."""

from __future__ import annotations

from types import ModuleType

import pytest
import torch

from granpinn import _C, reference
from granpinn.physics.constants import Physics
from granpinn.physics.laws import LAWS

from .manufactured import PHYSICS

LAW_NAMES = list(LAWS)
LIMITS = (0.02, 1e-3, 1e3, 1e-4)


def theta_of(name: str) -> torch.Tensor:
    return torch.tensor([p.start for p in LAWS[name].parameters], dtype=torch.float64)


def test_c_plus_plus_has_the_laws_of_python() -> None:
    assert _C.laws() == {name: len(law.parameters) for name, law in LAWS.items()}


def test_the_constants_have_the_names_and_the_order_of_c_plus_plus() -> None:
    assert tuple(_C.physics_fields()) == Physics._fields
    assert len(PHYSICS) == len(Physics._fields)


@pytest.mark.parametrize("name", LAW_NAMES)
def test_the_curve_is_that_of_the_oracle(name: str) -> None:
    inertia = torch.logspace(-6, 3, 50, dtype=torch.float64)
    expected = reference.friction(name, inertia, theta_of(name))
    found = LAWS[name].friction(inertia, *theta_of(name))
    torch.testing.assert_close(found, expected, rtol=1e-15, atol=0)


@pytest.mark.parametrize("name", LAW_NAMES)
def test_the_slope_is_the_derivative_of_the_curve(name: str) -> None:
    inertia = torch.logspace(-6, 3, 50, dtype=torch.float64, requires_grad=True)
    law, theta = LAWS[name], theta_of(name)
    (by_I,) = torch.autograd.grad(law.friction(inertia, *theta).sum(), inertia)
    expected = (inertia * by_I).detach()
    torch.testing.assert_close(law.slope(inertia.detach(), *theta), expected, rtol=1e-12, atol=0)


@pytest.mark.parametrize("name", LAW_NAMES)
def test_the_viscosity_of_a_law_with_its_gradient(name: str, ops: ModuleType) -> None:
    """eta and its derivatives by gamma_dot, p and every parameter, against the oracle."""
    rng = torch.Generator().manual_seed(0)
    rate, p = (0.1 + torch.rand(2, 100, generator=rng, dtype=torch.float64)).unbind(0)
    found, expected = [], []
    for module, out in ((ops, found), (reference, expected)):
        leaves = [x.clone().requires_grad_() for x in (rate, p, theta_of(name))]
        eta = module.viscosity(*leaves, *LIMITS, name)
        out.extend([eta, *torch.autograd.grad((eta * rate).sum(), leaves)])
    for a, b in zip(found, expected, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-12, atol=1e-14)


def test_mu_of_i_without_a_range_is_constant_friction(ops: ModuleType) -> None:
    rate, p = torch.linspace(0.1, 2, 64).double(), torch.linspace(0.3, 1, 64).double()
    flat, constant = torch.tensor([0.4, 0.4, 0.3]).double(), torch.tensor([0.4]).double()
    a = ops.viscosity(rate, p, flat, *LIMITS, "mu_of_i")
    b = ops.viscosity(rate, p, constant, *LIMITS, "coulomb")
    torch.testing.assert_close(a, b, rtol=1e-15, atol=0)


def test_an_unknown_law_is_refused(ops: ModuleType) -> None:
    one = torch.ones(1).double()
    with pytest.raises(ValueError, match="law must be one of 'mu_of_i', 'coulomb', got 'plastic'"):
        ops.viscosity(one, one, one, *LIMITS, "plastic")
