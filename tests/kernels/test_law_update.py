"""The update of the variables of a friction law."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from granpinn.kernels import step_ops

from .step_inputs import update_arguments


def theta_of(q: Tensor, kinds: tuple[str, ...], fixed: Tensor) -> Tensor:
    """theta [E, N] at q [E, N], as csrc/math/law_variables.h states it."""
    theta: list[Tensor] = []
    for k, kind in enumerate(kinds):
        if kind == "fixed":
            theta.append(fixed[:, k])
        elif kind == "logistic":
            theta.append(q[:, k].sigmoid())
        else:
            theta.append(q[:, k].exp() + (theta[-1] if kind == "log_above" else 0))
    return torch.stack(theta, 1)


@pytest.mark.parametrize(
    "kinds",
    [
        ("log", "log_above", "fixed"),
        ("logistic", "logistic", "fixed"),
        ("log",),
        ("log", "log_above", "log_above"),
        ("fixed", "log_above", "log"),
    ],
    ids=" ".join,
)
def test_the_law_moves_as_adam_moves_its_variables(
    kinds: tuple[str, ...], device: torch.device
) -> None:
    """theta and q, by autograd through theta(q) and torch's Adam; two steps."""
    N = len(kinds)
    arguments = update_arguments(3, 10, torch.float64)
    grad_theta, q = (torch.randn(3, N, dtype=torch.float64) for _ in range(2))
    theta = theta_of(q, kinds, torch.rand(3, N, dtype=torch.float64))
    moments = [torch.zeros(3, N, dtype=torch.float64) for _ in range(2)]
    arguments[14:19] = [grad_theta, q.clone(), *moments, theta.clone()]
    arguments[20] = torch.tensor([[step_ops.VARIABLES[kind] for kind in kinds]] * 3)
    arguments[21] = torch.tensor([-8.0, 8.0], dtype=torch.float64).repeat(3, N, 1)
    moved = [a.to(device) if isinstance(a, Tensor) else a for a in arguments]
    leaf = q.clone().requires_grad_()
    adam = torch.optim.Adam([leaf], lr=1e-3, betas=(0.9, 0.99), eps=1e-8)
    for _ in range(2):
        torch.ops.granpinn.update(*moved)
        (leaf.grad,) = torch.autograd.grad((theta_of(leaf, kinds, theta) * grad_theta).sum(), leaf)
        adam.step()
    expected = theta_of(leaf.detach(), kinds, theta)
    for found, wanted in ((moved[15], leaf.detach()), (moved[18], expected)):
        torch.testing.assert_close(found.cpu(), wanted, rtol=1e-13, atol=1e-15)
    assert moved[4].tolist() == [[2, 2]] * 3


def test_a_variable_stays_within_its_bounds(device: torch.device) -> None:
    arguments = update_arguments(3, 10, torch.float64)
    arguments[15][:, 0], arguments[15][:, 1] = 0.5, 0.5
    bounds = torch.tensor([[1.0, 2.0], [-2.0, -1.0], [0.0, 0.0]], dtype=torch.float64)
    arguments[21] = bounds.repeat(3, 1, 1)
    moved = [a.to(device) if isinstance(a, Tensor) else a for a in arguments]
    torch.ops.granpinn.update(*moved)
    assert moved[15][:, :2].tolist() == [[1.0, -1.0]] * 3
    assert torch.equal(moved[18][:, 1], moved[15][:, :2].exp().sum(1))
