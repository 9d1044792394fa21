"""The friction law: limits of the oracle's formula, and the op against it in both precisions."""

from __future__ import annotations

from types import ModuleType

import pytest
import torch
from torch import Tensor

from granpinn import reference
from granpinn.physics.laws import LAWS

from .configurations import SWITCHES
from .op_inputs import OWN

D, ETA_MIN, ETA_MAX, P_FLOOR = LAW = (0.02, 1e-3, 1e3, 1e-4)
THETA = (0.4, 0.65, 0.3)


@pytest.mark.parametrize("module", ["reference", "cpu_ops", "cuda_ops"])
@pytest.mark.parametrize(
    ("gamma_dot", "p", "eta"),
    [
        pytest.param(0.0, 1.0, ETA_MAX, id="rest under pressure"),
        pytest.param(0.0, 0.0, ETA_MIN, id="rest without pressure"),
        pytest.param(0.0, -1.0, ETA_MIN, id="rest under tension"),
        pytest.param(1e-9, 1.0, ETA_MAX, id="creep"),
        pytest.param(1e6, 1e-6, ETA_MIN, id="fast without pressure"),
        pytest.param(1.0, -1.0, ETA_MIN, id="tension"),
    ],
)
def test_limits(
    module: str, gamma_dot: float, p: float, eta: float, request: pytest.FixtureRequest
) -> None:
    """A limit holds exactly, and there every derivative is zero."""
    viscosity = (reference if module == "reference" else request.getfixturevalue(module)).viscosity
    inputs = [
        torch.tensor(value, dtype=torch.float64, requires_grad=True)
        for value in ([gamma_dot], [p], THETA)
    ]
    got = viscosity(*inputs, *LAW)
    assert got.item() == eta
    for derivative in torch.autograd.grad(got.sum(), inputs):
        assert not derivative.any()


def _samples(seed: int, law: str, dtype: torch.dtype) -> list[Tensor]:
    """gamma_dot and p over twelve decades, both signs of p, away from where a limit or the law
    switches, and from tensions that leave less than a tenth of a cohesion: a small difference."""
    rng = torch.Generator().manual_seed(seed)
    gamma_dot = 10 ** (12 * torch.rand(4000, generator=rng) - 9)
    p = 10 ** (8 * torch.rand(4000, generator=rng) - 7)
    p = torch.where(torch.rand(4000, generator=rng) < 0.1, -p, p)
    theta = torch.tensor(OWN[law])
    inertia = reference.inertial_number(gamma_dot, p, D, P_FLOOR)
    strength = reference.yield_stress(law, inertia, p, theta)
    eta = strength / gamma_dot
    switches = [(eta, ETA_MIN), (eta, ETA_MAX), (p.abs(), P_FLOOR)]
    switches += [(inertia, theta[k]) for k in SWITCHES.get(law, ())]
    away = torch.stack([(x / limit - 1).abs() > 1e-3 for x, limit in switches]).all(0)
    away &= (p > 0) | (strength.abs() > 0.1 * LAWS[law].cohesion_of(theta))
    return [x.to(dtype).requires_grad_() for x in (gamma_dot[away], p[away], theta)]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(5))
def test_no_worse_than_float32_autograd(seed: int, law: str, ops: ModuleType) -> None:
    """K-1 for the viscosity and its derivatives: at most 2 and 3 times autograd's error.

    Values span twenty decades: each is taken relative to itself, those by theta as sums.
    """

    def evaluate(module: ModuleType, dtype: torch.dtype) -> list[Tensor]:
        inputs = _samples(seed, law, dtype)
        eta = module.viscosity(*inputs, *LAW, law)
        weights = 1 / eta.detach()
        by_gamma_dot, by_p, by_theta = torch.autograd.grad((eta * weights).sum(), inputs)
        return [x.detach().double() for x in (eta, by_gamma_dot, by_p, by_theta)]

    exact = evaluate(reference, torch.float64)
    autograd, kernel = evaluate(reference, torch.float32), evaluate(ops, torch.float32)
    for factor, x, a, k in zip((2, 3, 3, 3), exact, autograd, kernel, strict=True):
        scale = torch.where(x == 0, torch.ones_like(x), x)
        error_a, error_k = (((y - x) / scale).square().mean().sqrt() for y in (a, k))
        assert x.any()
        assert error_k <= factor * max(float(error_a), torch.finfo(torch.float32).eps)
