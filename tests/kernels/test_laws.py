"""The laws in Python, in C++ and in the oracle are the same ones."""

from __future__ import annotations

from types import ModuleType

import pytest
import torch

from granpinn import _C, reference
from granpinn.physics.laws import LAWS

from .configurations import Form, problem, small
from .manufactured import PHYSICS

LAW_NAMES = list(LAWS)
LIMITS = (0.02, 1e-3, 1e3, 1e-4)


def theta_of(name: str) -> torch.Tensor:
    return torch.tensor([p.typical for p in LAWS[name].parameters], dtype=torch.float64)


def test_c_plus_plus_has_the_laws_of_python() -> None:
    assert _C.laws() == {name: len(law.parameters) for name, law in LAWS.items()}


@pytest.mark.parametrize("name", LAW_NAMES)
def test_the_curve_is_that_of_the_oracle(name: str) -> None:
    inertia = torch.logspace(-6, 3, 50, dtype=torch.float64)
    expected = reference.friction(name, inertia, theta_of(name))
    found = LAWS[name].friction(inertia, *theta_of(name))
    # a power of I is exp(n ln I), which multiplies the rounding by |n ln I| < 20
    torch.testing.assert_close(found, expected, rtol=1e-14, atol=0)


@pytest.mark.parametrize("name", LAW_NAMES)
def test_the_slope_is_the_derivative_of_the_curve(name: str) -> None:
    inertia = torch.logspace(-6, 3, 50, dtype=torch.float64, requires_grad=True)
    law, theta = LAWS[name], theta_of(name)
    (by_I,) = torch.autograd.grad(law.friction(inertia, *theta).sum(), inertia)
    expected = (inertia * by_I).detach()
    torch.testing.assert_close(
        law.slope(inertia.detach(), *theta), expected, rtol=1e-12, atol=1e-15
    )


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("form", ["mixed", "strong"])
@pytest.mark.parametrize("name", LAW_NAMES)
def test_residuals_of_material_at_rest_are_finite(
    name: str, form: Form, dtype: torch.dtype, ops: ModuleType
) -> None:
    """I is nearly 0 in a network of zero weights, and 1e-30 with a small grain diameter."""
    case = problem(small(form, points=40, surface_points=0, law=name)).to(dtype)
    case = case._replace(params=0 * case.params, theta=theta_of(name).to(dtype))
    for diameter in (0.02, 1e-24):
        physics = [diameter, *PHYSICS[1:]]
        for result in ops.residual_loss(*case._replace(physics=physics)):
            assert result.isfinite().all()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("inertia", [0.0, 1e-38, 1e-30, 1e-3, 1e4])
@pytest.mark.parametrize("name", LAW_NAMES)
def test_curve_and_gradients_are_finite(name: str, inertia: float, dtype: torch.dtype) -> None:
    law = LAWS[name]
    I = torch.tensor([inertia], dtype=dtype, requires_grad=True)
    theta = theta_of(name).to(dtype).requires_grad_()
    for function in (law.friction, law.slope):
        values = function(I, *theta)
        assert values.isfinite().all()
        for part in torch.autograd.grad(values.sum(), (I, theta)):
            assert part.isfinite().all()


def test_the_regularised_law_is_continuous_and_its_slope_jumps() -> None:
    law, theta = LAWS["regularised"], theta_of("regularised").tolist()
    _, _, _, _, alpha, I_1 = theta
    low, high = I_1 * (1 - 1e-12), I_1 * (1 + 1e-12)
    mu_1 = law.friction(I_1, *theta)
    assert law.friction(low, *theta) == pytest.approx(mu_1, rel=1e-11)
    assert law.friction(high, *theta) == pytest.approx(mu_1, rel=1e-11)
    assert law.slope(low, *theta) == pytest.approx(mu_1**3 / (2 * alpha), rel=1e-10)
    assert law.slope(high, *theta) < law.slope(low, *theta) / 2


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


@pytest.mark.parametrize("form", ["mixed", "strong"])
def test_members_with_laws_of_their_own(form: Form, ops: ModuleType) -> None:
    """A batch gives what its members give alone; theta is filled up to the longest law."""
    case = problem(small(form, members=len(LAW_NAMES)))
    of_laws = [theta_of(name) for name in LAW_NAMES]
    longest = max(map(len, of_laws))
    theta = torch.stack(
        [torch.nn.functional.pad(t, (0, longest - len(t)), value=7) for t in of_laws]
    )
    together = ops.residual_loss(*case._replace(theta=theta, law=",".join(LAW_NAMES)))
    for e, (name, own) in enumerate(zip(LAW_NAMES, of_laws, strict=True)):
        alone = case.member(e)._replace(theta=own, law=name)
        loss, terms, grad_params, grad_theta = (result[e] for result in together)
        assert not grad_theta[len(own) :].any()
        found = (loss, terms, grad_params, grad_theta[: len(own)])
        for a, b in zip(found, ops.residual_loss(*alone), strict=True):
            torch.testing.assert_close(a, b, rtol=1e-13, atol=0)
