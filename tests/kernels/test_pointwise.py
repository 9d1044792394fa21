"""V-1 for the equations of the kernels, and the fused loss against the sum of their residuals."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Any

import pytest
import torch

from granpinn import reference

from .configurations import SHARED, Form, Problem, configuration, problem, small
from .manufactured import CASES, PHYSICS, exact, manufactured
from .test_oracle import FORMS, POINTS, worst_relative_error


@pytest.mark.parametrize(("name", "law"), CASES)
@pytest.mark.parametrize("form", FORMS)
def test_residuals_of_manufactured_fields(name: str, form: str, law: str, ops: ModuleType) -> None:
    case = manufactured(name, form, law)
    points, truth = exact(name, form, law, POINTS)
    got = ops.pointwise_residuals(case.raw_jets(points), case.theta, PHYSICS, form, law)
    assert worst_relative_error(got, truth) <= 1e-12


def single(index: int) -> Problem:
    """A row of the table with 33 points, its first network only."""
    case = problem(replace(configuration(index), points=33))
    return case.member(0) if case.params.ndim == 2 else case


@pytest.mark.parametrize("index", range(0, 40, 4))
def test_the_fused_loss_is_that_of_its_jets(index: int, ops: ModuleType) -> None:
    """Network, jets and equations in separate ops give the terms of the fused loss."""
    case = single(index)
    jets = ops.network_jet(*case.network, 2 if case.spec.form == "strong" else 1)
    e = ops.pointwise_residuals(jets, case.theta, case.physics, case.spec.form, case.law)
    if case.batch.source is not None:
        e[:, :2] -= case.batch.source
    w_f = case.batch.point_weights[:, 1:]
    N = len(case.batch.points)
    _, terms, _, _ = ops.residual_loss(*case)
    expected = torch.stack([(w_f * part**2).sum() for part in (e[:, :2], e[:, 2:3], e[:, 3:])])
    torch.testing.assert_close(terms[2:], expected / (2 * N), rtol=1e-11, atol=0)


@pytest.mark.parametrize("members", [None, 1, 3])
@pytest.mark.parametrize("form", [*FORMS, "data"])
def test_loss_and_gradient_in_float64(form: str, members: int | None, ops: ModuleType) -> None:
    """Every output of the fused loss, to the last digits; "data" leaves the equations out."""
    case = problem(small("strong" if form == "strong" else "mixed", members=members))
    names = ("loss", "terms", "grad_params", "grad_theta")
    exact, got = (
        dict(zip(names, module.residual_loss(*case, equations=form != "data"), strict=True))
        for module in (reference, ops)
    )
    for name in names:
        torch.testing.assert_close(
            got[name], exact[name], rtol=1e-9, atol=1e-11 * float(exact[name].abs().max())
        )
    if form == "data":
        assert not got["terms"][..., 2:].any()
        assert not got["grad_theta"].any()


@pytest.mark.parametrize("changes", [{}, {"source": True}, {"source": True, "index": SHARED}])
@pytest.mark.parametrize("form", FORMS)
def test_members_of_an_ensemble_are_independent(
    form: Form, changes: dict[str, Any], ops: ModuleType
) -> None:
    """An ensemble gives, bit for bit, what its members give alone; its points may be shared."""
    case = problem(small(form, members=3, **changes)).to(torch.float32)
    together = ops.residual_loss(*case)
    for e in range(3):
        for one, all_ in zip(ops.residual_loss(*case.member(e)), together, strict=True):
            assert torch.equal(one, all_[e])


@pytest.mark.parametrize("form", FORMS)
def test_a_source_of_zero_has_the_bits_of_none(form: Form, ops: ModuleType) -> None:
    case = problem(small(form, points=70, hidden=(40, 33), members=2)).to(torch.float32)
    zero = case._replace(batch=case.batch._replace(source=torch.zeros_like(case.batch.velocity)))
    for a, b in zip(ops.residual_loss(*zero), ops.residual_loss(*case), strict=True):
        assert torch.equal(a, b)


def test_first_and_second_order_jets_agree(ops: ModuleType) -> None:
    case = problem(small("strong"))
    value, first, second = (
        ops.network_value(*case.network),
        ops.network_jet(*case.network, 1),
        ops.network_jet(*case.network, 2),
    )
    torch.testing.assert_close(first[0], value, rtol=1e-13, atol=1e-14)
    torch.testing.assert_close(second[:4], first, rtol=1e-13, atol=1e-14)
