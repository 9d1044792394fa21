"""K-2, gradcheck of every differentiable input, and V-2, derivatives against differences."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from granpinn import reference
from granpinn.physics.laws import LAWS
from granpinn.reference.equations import SMOOTHING, pressure

from .configurations import Form, Problem, Regime, problem, small
from .op_inputs import OWN, learning

LAW = (0.02, 1e-3, 1e3, 1e-4)  # d, eta_min, eta_max, p_floor
FORMS = ("strong", "mixed")
REGIMES = ("flowing", "low pressure", "slow")


def tiny(
    form: Form, members: int | None = None, law: str = "mu_of_i", source: bool = False
) -> Problem:
    return problem(small(form, points=5, hidden=(6, 4), members=members, law=law, source=source))


def flow(n: int, law: str = "mu_of_i") -> list[Tensor]:
    """gamma_dot, p [n] and theta in flowing material."""
    rng = torch.Generator().manual_seed(0)
    gamma_dot, p = (0.5 + torch.rand(2, n, generator=rng, dtype=torch.float64)).unbind(0)
    return [gamma_dot, p, torch.tensor(OWN[law], dtype=torch.float64)]


def differentiable(*tensors: Tensor) -> tuple[Tensor, ...]:
    return tuple(tensor.clone().requires_grad_() for tensor in tensors)


def gradcheck(function: Callable[..., Any], *inputs: Tensor) -> None:
    assert torch.autograd.gradcheck(
        function, differentiable(*inputs), rtol=1e-5, atol=1e-7, nondet_tol=0
    )


@pytest.mark.parametrize("members", [None, 2])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_gradcheck_of_the_network(order: int, members: int | None, ops: ModuleType) -> None:
    case = tiny("mixed", members)

    def jet(params: Tensor) -> Any:
        arguments = (case.batch.points, params, *case.network[2:])
        return ops.network_jet(*arguments, order) if order else ops.network_value(*arguments)

    gradcheck(jet, case.params)


@pytest.mark.parametrize("precision", ["fp32", "fast"])
@pytest.mark.parametrize("z", [-30.0, -90.0, -120.0, -1e4])
def test_gradient_where_the_pressure_underflows(z: float, precision: str, ops: ModuleType) -> None:
    """softplus(z) is as good as zero, exp(-z) beyond float32: no NaN in any gradient."""
    case = problem(small("mixed", points=40, hidden=(40, 30))).to(torch.float32)
    case.params[-3] = z  # bias of the output from which the pressure is made
    for result in ops.residual_loss(*case, precision=precision):
        assert result.isfinite().all()


# All laws in both forms; of an ensemble two laws, and of the data, which have no law, one.
LOSSES = [(form, None, law, False) for form in FORMS for law in LAWS]
LOSSES += [(form, 2, law, False) for form in FORMS for law in ("mu_of_i", "cohesive")]
LOSSES += [("data", members, "mu_of_i", False) for members in (None, 2)]
LOSSES += [(form, members, "mu_of_i", True) for form in FORMS for members in (None, 2)]


@pytest.mark.parametrize(("form", "members", "law", "source"), LOSSES)
def test_gradcheck_of_the_loss(
    form: str, members: int | None, law: str, source: bool, ops: ModuleType
) -> None:
    case = tiny("strong" if form == "strong" else "mixed", members, law, source)

    def loss(params: Tensor, theta: Tensor) -> Any:
        moved = case._replace(params=params, theta=theta)
        return ops.residual_loss(*moved, equations=form != "data")[0]

    gradcheck(loss, case.params, case.theta)


@pytest.mark.parametrize("regime", REGIMES)
@pytest.mark.parametrize("form", FORMS)
def test_gradient_on_both_sides_of_every_switch(
    form: Form, regime: Regime, ops: ModuleType
) -> None:
    """Against nested autograd in float64: floored pressures, viscosities beyond both limits."""
    case = problem(small(form, points=34, regime=regime))
    d, g_x, g_y, _, _, U, P, _, *rest = case.physics
    jet = reference.network_jet(*case.network, 1).detach()
    p = pressure(jet[0], P)
    p_floor = float(p.abs().quantile(0.5))
    u_x, u_y, v_x, v_y = (U * jet[channel, :, k] for k in (0, 1) for channel in (1, 2))
    gamma_dot = torch.sqrt(2 * u_x**2 + 2 * v_y**2 + (u_y + v_x) ** 2 + SMOOTHING)
    mu = reference.friction(
        "mu_of_i", reference.inertial_number(gamma_dot, p, d, p_floor), case.theta
    )
    eta_min, eta_max = (float((mu * p / gamma_dot).quantile(q)) for q in (0.3, 0.7))
    case = case._replace(physics=[d, g_x, g_y, eta_min, eta_max, U, P, p_floor, *rest])
    for got, exact in zip(ops.residual_loss(*case), reference.residual_loss(*case), strict=True):
        assert exact.any()
        assert (got - exact).norm() <= 1e-10 * exact.norm()


@pytest.mark.parametrize("law", LAWS)
def test_gradcheck_of_the_viscosity(law: str, ops: ModuleType) -> None:
    """Also far below and above the I of a typical flow, where laws have other branches."""
    gamma_dot, p, theta = flow(20, law)
    for scale in (1e-2, 1.0, 100.0):
        gradcheck(lambda *inputs: ops.viscosity(*inputs, *LAW, law), scale * gamma_dot, p, theta)


@pytest.mark.parametrize("form", FORMS)
def test_backward_hands_out_the_returned_gradients(form: Form, ops: ModuleType) -> None:
    case = learning(tiny(form, 2))
    loss, terms, grad_params, grad_theta = ops.residual_loss(*case)
    assert not any(x.requires_grad for x in (terms, grad_params, grad_theta))
    weights = torch.tensor([2.0, -3.0], dtype=torch.float64)
    by_params, by_theta = torch.autograd.grad(loss, (case.params, case.theta), weights)
    assert by_params.any()
    assert by_theta.any()
    assert torch.equal(by_params, weights.unsqueeze(1) * grad_params)
    assert torch.equal(by_theta, weights.unsqueeze(1) * grad_theta)


def test_second_derivatives_are_refused(ops: ModuleType) -> None:
    """A gradient of a gradient must raise: without its second-order part it would be wrong."""
    case = learning(tiny("mixed"))
    gamma_dot, p, law = differentiable(*flow(4))
    outputs: list[tuple[Tensor, Tensor]] = [
        (ops.network_value(*case.network).square().sum(), case.params),
        (ops.network_jet(*case.network, 1).square().sum(), case.params),
        (ops.residual_loss(*case)[0].square(), case.params),
        (ops.viscosity(gamma_dot, p, law, *LAW).square().sum(), gamma_dot),
    ]
    for output, leaf in outputs:
        (first,) = torch.autograd.grad(output, leaf, create_graph=True)
        with pytest.raises(RuntimeError):
            torch.autograd.grad(first.sum(), leaf)


def slope(
    function: Callable[[Tensor], Tensor], at: Tensor, direction: Tensor, derivative: Tensor
) -> float:
    """Order of convergence of central differences of `function` to `derivative`.

    A right derivative leaves the truncation error h^2; a wrong one a constant, slope 0.
    """
    steps = np.geomspace(1e-3, 1e-2, 6)
    errors = []
    for h in steps:
        difference = (function(at + h * direction) - function(at - h * direction)) / (2 * h)
        errors.append(float((difference - derivative).norm()))
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def unit(like: Tensor) -> Tensor:
    rng = torch.Generator().manual_seed(3)
    direction = torch.randn(like.shape, generator=rng, dtype=like.dtype)
    unit_vector: Tensor = direction / direction.norm()
    return unit_vector


@pytest.mark.parametrize(
    ("channel", "of", "axis"),
    [(1, 0, 0), (2, 0, 1), (3, 0, 2), (4, 1, 0), (5, 1, 1), (5, 2, 0), (6, 2, 1)],
    ids=["z_x", "z_y", "z_t", "z_xx", "z_xy as (z_x)_y", "z_xy as (z_y)_x", "z_yy"],
)
def test_slope_of_jet_channels(channel: int, of: int, axis: int, ops: ModuleType) -> None:
    case = problem(small("mixed"))

    def jet(points: Tensor, order: int) -> Any:
        return ops.network_jet(points, *case.network[1:], order)

    direction = torch.zeros(3, dtype=torch.float64)
    direction[axis] = 1
    derivative = jet(case.batch.points, 2)[channel]
    order = slope(lambda points: jet(points, 1)[of], case.batch.points, direction, derivative)
    assert order == pytest.approx(2, abs=0.05)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_slope_of_the_jet_in_the_weights(order: int, ops: ModuleType) -> None:
    case = problem(small("strong"))
    direction = unit(case.params)

    def jet(params: Tensor) -> Any:
        arguments = (case.batch.points, params, *case.network[2:])
        jet: Tensor = ops.network_jet(*arguments, order) if order else ops.network_value(*arguments)
        return jet.square().sum()

    (params,) = differentiable(case.params)
    (gradient,) = torch.autograd.grad(jet(params), params)
    assert slope(jet, case.params, direction, gradient @ direction) == pytest.approx(2, abs=0.05)


@pytest.mark.parametrize("variable", ["params", "theta"])
@pytest.mark.parametrize("form", FORMS)
def test_slope_of_the_loss(form: Form, variable: str, ops: ModuleType) -> None:
    case = problem(small(form))
    at = getattr(case, variable)
    # along mu_s or mu_2 alone the strong loss is a parabola, exact at every step: go along I_0 too
    direction = unit(at)
    _, _, grad_params, grad_theta = ops.residual_loss(*case)
    gradient = grad_params if variable == "params" else grad_theta

    def loss(moved: Tensor) -> Any:
        return ops.residual_loss(*case._replace(**{variable: moved}))[0]

    assert slope(loss, at, direction, gradient @ direction) == pytest.approx(2, abs=0.05)


@pytest.mark.parametrize("index", [0, 1, 2], ids=["gamma_dot", "p", "theta"])
def test_slope_of_the_viscosity(index: int, ops: ModuleType) -> None:
    inputs = flow(50)
    leaves = differentiable(*inputs)
    gradient = torch.autograd.grad(ops.viscosity(*leaves, *LAW).sum(), leaves)[index]
    direction = unit(inputs[index])

    def total(moved: Tensor) -> Any:
        arguments = [moved if i == index else x for i, x in enumerate(inputs)]
        return ops.viscosity(*arguments, *LAW).sum()

    order = slope(total, inputs[index], direction, gradient @ direction)
    assert order == pytest.approx(2, abs=0.05)
