"""The source term of the momentum equation: a force per mass at every point, beside gravity.

The table of K-1 has rows with a source, and so have the inputs of opcheck (K-3).
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch
from torch import Tensor

from granpinn import reference
from granpinn.training.objective import INTERIOR

from .accuracy import EPSILON, GROSS_FACTOR
from .configurations import SHARED, Form, Problem, problem, small
from .manufactured import PHYSICS, manufactured
from .op_inputs import learning
from .step_inputs import MEMBERS, SIZES, STEP, batch_arguments, loss_arguments, source
from .test_gradients import gradcheck
from .test_small_work import MANY, TF32, relative

FORMS: tuple[Form, ...] = ("mixed", "strong")


def posed(form: Form, **changes: Any) -> Problem:
    return problem(small(form, **({"points": 5, "hidden": (6, 4), "source": True} | changes)))


def with_source(case: Problem, source: Tensor | None) -> Problem:
    return case._replace(batch=case.batch._replace(source=source))


@pytest.mark.parametrize("form", FORMS)
def test_manufactured_fields_solve_momentum_with_their_source(form: Form) -> None:
    """V-1 for the oracle: sympy's residuals as the source leave none; the others stay."""
    case = manufactured("waves", form)
    points = case.points(2000)
    exact = torch.from_numpy(case.residuals(points).astype(float))
    found = reference.residuals(
        case.raw_network(), torch.from_numpy(points), case.theta, PHYSICS, form, source=exact[:, :2]
    ).detach()
    assert float(found[:, :2].abs().max()) <= 1e-12 * float(exact.abs().max())
    torch.testing.assert_close(found[:, 2:], exact[:, 2:], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("members", [None, 2])
@pytest.mark.parametrize("form", FORMS)
def test_gradcheck(form: Form, members: int | None, ops: ModuleType) -> None:
    case = posed(form, members=members)

    def loss(params: Tensor, theta: Tensor) -> Any:
        return ops.residual_loss(*case._replace(params=params, theta=theta))[0]

    gradcheck(loss, case.params, case.theta)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize("form", FORMS)
def test_a_source_of_zero_has_the_bits_of_none(
    form: Form, dtype: torch.dtype, ops: ModuleType
) -> None:
    case = posed(form, points=70, hidden=(40, 33), members=2).to(dtype)
    none = ops.residual_loss(*with_source(case, None))
    zero = with_source(case, torch.zeros_like(case.batch.velocity))
    for a, b in zip(ops.residual_loss(*zero), none, strict=True):
        assert torch.equal(a, b)
    assert not torch.equal(ops.residual_loss(*case)[0], none[0])


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("form", FORMS)
def test_members_have_their_own_source_or_share_one(
    form: Form, shared: bool, ops: ModuleType
) -> None:
    case = posed(form, members=3, **({"index": SHARED} if shared else {}))
    assert case.batch.source is not None
    assert case.batch.source.ndim == (2 if shared else 3)
    together = ops.residual_loss(*case)
    for e in range(3):
        for a, b in zip(together, ops.residual_loss(*case.member(e)), strict=True):
            assert torch.equal(a[e], b)


@pytest.mark.parametrize("form", FORMS)
def test_nothing_wrong_is_swallowed(form: Form, ops: ModuleType) -> None:
    case = posed(form)
    assert case.batch.source is not None
    source = case.batch.source.clone()
    with pytest.raises(ValueError, match=r"source must be \[5, 2\], got \[4, 2\]"):
        ops.residual_loss(*with_source(case, source[:4]))
    with pytest.raises(TypeError, match="source must have the type and device of params"):
        ops.residual_loss(*with_source(case, source.to(torch.float32)))
    with pytest.raises(ValueError, match="source must not require a gradient"):
        ops.residual_loss(*learning(with_source(case, source.clone().requires_grad_())))
    source[-1, -1] = torch.nan
    assert ops.residual_loss(*with_source(case, source))[0].isnan()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize("form", ["mixed", "data"])
def test_a_batch_has_the_source_of_its_points(
    form: str, dtype: torch.dtype, device: torch.device
) -> None:
    from granpinn.kernels import ops

    arguments, force = batch_arguments(dtype, device), source(dtype, device)
    *drawn, found = torch.ops.granpinn.draw_batch(*arguments, 13, 6, 2, force)
    for e, (which, seed) in enumerate(MEMBERS):
        begin = 0 if which == 0 else SIZES[0][0]
        i = begin + ops.sample_indices(seed, STEP, INTERIOR, 39, SIZES[which][0])[-13:]
        assert torch.equal(found[e].cpu(), force.cpu()[i])
    params, theta, *rest, _, law, precision = loss_arguments(len(MEMBERS), dtype, device)
    settings = (*rest, form, law, precision)
    whole = torch.ops.granpinn.batch_loss(*arguments, 13, 6, 2, params, theta, *settings, force)
    expected = torch.ops.granpinn.residual_loss(params, theta, *drawn, *settings, found)
    for a, b in zip(whole, expected, strict=True):
        assert torch.equal(a, b)


@pytest.mark.parametrize("precision", ["fp32", "fast"])
@pytest.mark.parametrize("law", ["mu_of_i", "power"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("hidden", "points"),
    [((33, 40), 37), ((201, 250), 37), ((120, 128), None)],
    ids=["narrow", "wide", "large tiles"],
)
def test_fused_loss_on_the_gpu(
    hidden: tuple[int, ...],
    points: int | None,
    form: Form,
    law: str,
    precision: str,
    cuda_ops: ModuleType,
) -> None:
    """The last tile is not full; small tiles, and large ones."""
    sizes = {"points": points or MANY[form], "surface_points": 19, "hidden": hidden}
    case = posed(form, law=law, members=2, **sizes)
    low = case.to(torch.float32)
    found = cuda_ops.residual_loss(*low, precision=precision)
    exact = reference.residual_loss(*case)
    yardstick = reference.residual_loss(*low)
    for index, unit in ((0, EPSILON), (2, TF32 if precision == "fast" else EPSILON)):
        autograd = relative(yardstick[index], exact[index])
        assert relative(found[index], exact[index]) <= GROSS_FACTOR * max(unit, autograd)


@pytest.mark.parametrize("form", FORMS)
def test_layered_loss_on_the_gpu(form: Form, cuda_ops: ModuleType, cpu_ops: ModuleType) -> None:
    case = posed(form, points=300, hidden=(17, 8), members=3)
    for a, b in zip(cuda_ops.residual_loss(*case), cpu_ops.residual_loss(*case), strict=True):
        torch.testing.assert_close(a, b, rtol=1e-9, atol=1e-11 * float(b.abs().max()))
