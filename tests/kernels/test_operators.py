"""K-3: torch.library.opcheck, on inputs that are empty, strided, shared, batched or traced.

opcheck tests the schema, the registration of the gradient, the fake kernel, and tracing with
static and with dynamic shapes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import Any

import pytest
import torch
from torch import Tensor

from .configurations import SHARED, Form, Problem, problem, small
from .devices import device_of, moved

LAW = (0.02, 1e-3, 1e3, 1e-4)
Arguments = tuple[Any, ...]


def tiny(form: Form = "mixed", **changes: Any) -> Problem:
    return problem(small(form, **({"points": 5, "hidden": (6, 4)} | changes)))


def learning(case: Problem) -> Problem:
    return replace(case, params=case.params.requires_grad_(), theta=case.theta.requires_grad_())


def strided(tensor: Tensor) -> Tensor:
    """The same values with gaps between them, last axis not contiguous."""
    wide = tensor.new_zeros(*tensor.shape[:-1], 2 * tensor.shape[-1])
    wide[..., ::2] = tensor
    return wide[..., ::2]


def with_gaps(case: Problem) -> Problem:
    gaps: dict[str, Any] = {k: strided(v) for k, v in vars(case).items() if isinstance(v, Tensor)}
    return replace(case, **gaps)


def jet(case: Problem, order: int) -> Arguments:
    return (*case.network, order)


def jet_backward(case: Problem, order: int) -> Arguments:
    C, N, K = {0: 1, 1: 4, 2: 7}[order], case.points.shape[-2], case.widths[-1]
    grad = torch.ones(*case.params.shape[:-1], C, N, K, dtype=case.params.dtype)
    return (grad, *case.network, order)


def flow(n: int, dtype: torch.dtype = torch.float64, learn: bool = False) -> Arguments:
    gamma_dot, p = (torch.linspace(a, 2, n, dtype=dtype) for a in (0.5, 0.25))
    theta = torch.tensor([0.4, 0.65, 0.3], dtype=dtype)
    return (*(x.requires_grad_(learn) for x in (gamma_dot, p, theta)), "mu_of_i", *LAW)


def raw_jets(form: Form, N: int, K: int) -> Arguments:
    case = tiny(form)
    C = 7 if form == "strong" else 4
    jets = torch.linspace(-1, 1, C * N * K, dtype=torch.float64).reshape(C, N, K)
    return (jets, case.theta, case.physics, form, case.law)


def as_tensors(loss: Arguments) -> Arguments:
    """The arguments of the operator itself: the input map and the physics as tensors."""
    constants = (loss[0].new_tensor(values) for values in loss[9:12])
    return (*loss[:9], *constants, *loss[12:], "fp32")


def leaf(x: Any, device: str) -> Any:
    return moved(x.detach(), device).requires_grad_(x.requires_grad) if torch.is_tensor(x) else x


CALLS: dict[str, tuple[str, Callable[[], Arguments]]] = {
    "jet, order 0": ("network_jet", lambda: jet(learning(tiny()), 0)),
    "jet, order 1": ("network_jet", lambda: jet(learning(tiny()), 1)),
    "jet, order 2": ("network_jet", lambda: jet(learning(tiny()), 2)),
    "jet, float32": ("network_jet", lambda: jet(learning(tiny().to(torch.float32)), 2)),
    "jet, no gradient": ("network_jet", lambda: jet(tiny(), 2)),
    "jet, no points": ("network_jet", lambda: jet(learning(tiny(points=0)), 2)),
    "jet, one point": ("network_jet", lambda: jet(learning(tiny(points=1)), 1)),
    "jet, no hidden layer": ("network_jet", lambda: jet(learning(tiny(hidden=())), 2)),
    "jet, strided": ("network_jet", lambda: jet(with_gaps(tiny()), 1)),
    "jet, ensemble": ("network_jet", lambda: jet(learning(tiny(members=3)), 2)),
    "jet, shared points": (
        "network_jet",
        lambda: jet(learning(tiny(index=SHARED, members=3)), 1),
    ),
    "jet backward": ("network_jet_backward", lambda: jet_backward(tiny(), 2)),
    "jet backward, no points": ("network_jet_backward", lambda: jet_backward(tiny(points=0), 1)),
    "jet backward, ensemble": ("network_jet_backward", lambda: jet_backward(tiny(members=2), 0)),
    "loss, mixed": ("residual_loss", lambda: learning(tiny()).loss),
    "loss, strong": ("residual_loss", lambda: learning(tiny("strong")).loss),
    "loss, data": ("residual_loss", lambda: (*learning(tiny()).loss[:-2], "data", "mu_of_i")),
    "loss, float32": ("residual_loss", lambda: learning(tiny().to(torch.float32)).loss),
    "loss, no points": ("residual_loss", lambda: learning(tiny(points=0)).loss),
    "loss, no surface": ("residual_loss", lambda: learning(tiny(surface_points=0)).loss),
    "loss, nothing": ("residual_loss", lambda: learning(tiny(points=0, surface_points=0)).loss),
    "loss, strided": ("residual_loss", lambda: with_gaps(tiny()).loss),
    "loss, ensemble": ("residual_loss", lambda: learning(tiny("strong", members=2)).loss),
    "loss, shared data": ("residual_loss", lambda: learning(tiny(index=SHARED, members=2)).loss),
    "viscosity": ("viscosity", lambda: flow(7, learn=True)),
    "viscosity, float32": ("viscosity", lambda: flow(7, torch.float32, learn=True)),
    "viscosity, no points": ("viscosity", lambda: flow(0, learn=True)),
    "viscosity, strided": (
        "viscosity",
        lambda: (*(strided(x) for x in flow(7)[:3]), "mu_of_i", *LAW),
    ),
    "viscosity backward": ("viscosity_backward", lambda: (torch.ones(7).double(), *flow(7))),
    "residuals, strong": ("pointwise_residuals", lambda: raw_jets("strong", 4, 3)),
    "residuals, strong of five": ("pointwise_residuals", lambda: raw_jets("strong", 4, 5)),
    "residuals, mixed": ("pointwise_residuals", lambda: raw_jets("mixed", 4, 5)),
    "residuals, no points": ("pointwise_residuals", lambda: raw_jets("mixed", 0, 5)),
    "indices": ("sample_indices", lambda: (torch.tensor(3), 1, 0, 9, 100)),
    "no indices": ("sample_indices", lambda: (torch.tensor(3), 1, 0, 0, 100)),
}


@pytest.mark.parametrize("name", CALLS)
def test_opcheck(name: str, ops: ModuleType) -> None:
    operator, arguments = CALLS[name]
    given = arguments()
    if operator == "residual_loss":
        given = as_tensors(given)
    torch.library.opcheck(
        getattr(torch.ops.granpinn, operator).default,
        tuple(leaf(x, device_of(ops)) for x in given),
    )


@pytest.mark.parametrize("case", [tiny(), tiny("strong", members=2)], ids=["one", "ensemble"])
def test_strides_do_not_matter(case: Problem, ops: ModuleType) -> None:
    gaps = with_gaps(case)
    assert not gaps.points.is_contiguous()
    for a, b in zip(ops.residual_loss(*case.loss), ops.residual_loss(*gaps.loss), strict=True):
        assert torch.equal(a, b)
    assert torch.equal(ops.network_jet(*case.network, 2), ops.network_jet(*gaps.network, 2))


def test_nothing_in_gives_zero(ops: ModuleType) -> None:
    case = tiny(points=0, surface_points=0)
    for output in ops.residual_loss(*case.loss):
        assert not output.any()
    assert ops.network_value(*case.network).shape == (0, 5)
    assert ops.strong_residual(*case.strong).shape == (0, 3)
    params = case.params.clone().requires_grad_()
    jet_ = ops.network_jet(case.points, params, *case.network[2:], 1)
    (gradient,) = torch.autograd.grad(jet_.sum(), params)
    assert not gradient.any()


@pytest.mark.parametrize(
    "name",
    [
        "params",
        "theta",
        "points",
        "velocity",
        "point_weights",
        "surface_points",
        "surface_pressure",
        "term_weights",
    ],
)
@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_not_a_number_is_never_swallowed(form: Form, name: str, ops: ModuleType) -> None:
    """One NaN anywhere shows in the loss: the guard of the training loop looks nowhere else."""
    case = tiny(form)
    damaged = getattr(case, name).clone()
    damaged.view(-1)[-1] = torch.nan
    loss, _, _, _ = ops.residual_loss(*replace(case, **{name: damaged}).loss)
    assert loss.isnan()
