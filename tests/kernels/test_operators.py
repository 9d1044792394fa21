"""K-3: torch.library.opcheck, on inputs that are empty, strided, shared, batched or traced.

opcheck tests the schema, the registration of the gradient, the fake kernel, and, for every sixth
input, tracing with dynamic shapes, which takes most of the time.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch

from granpinn.physics.terms import LossPoints

from .configurations import Form, Problem
from .devices import device_of, moved
from .op_inputs import INPUTS, operands, tiny, with_gaps

CHECKS = (
    "test_schema",
    "test_autograd_registration",
    "test_faketensor",
    "test_aot_dispatch_dynamic",
)
ROWS = [
    (operator, name, CHECKS[: 4 if k % 6 == 1 else 3])
    for operator, inputs in INPUTS.items()
    for k, name in enumerate(inputs)
]


def leaf(x: Any, device: str) -> Any:
    return moved(x.detach(), device).requires_grad_(x.requires_grad) if torch.is_tensor(x) else x


@pytest.mark.parametrize(("operator", "name", "checks"), ROWS)
def test_opcheck(operator: str, name: str, checks: tuple[str, ...], ops: ModuleType) -> None:
    given = INPUTS[operator][name]()
    torch.library.opcheck(
        getattr(torch.ops.granpinn, operator).default,
        tuple(leaf(x, device_of(ops)) for x in given),
        test_utils=checks,
    )


def test_every_operator_has_inputs() -> None:
    """A new operator needs 20 rows of its own."""
    from granpinn.kernels import ops  # noqa: F401  (registers the operators)

    names = {n for n in torch._C._dispatch_get_all_op_names() if n.startswith("granpinn::")}
    assert {f"granpinn::{operator}" for operator in INPUTS} == names
    assert min(len(inputs) for inputs in INPUTS.values()) >= 20


@pytest.mark.parametrize("case", [tiny(), tiny("strong", members=2)], ids=["one", "ensemble"])
def test_strides_do_not_matter(case: Problem, ops: ModuleType) -> None:
    gaps = with_gaps(case)
    assert not gaps.batch.points.is_contiguous()
    for a, b in zip(ops.residual_loss(*case), ops.residual_loss(*gaps), strict=True):
        assert torch.equal(a, b)
    assert torch.equal(ops.network_jet(*case.network, 2), ops.network_jet(*gaps.network, 2))


def test_nothing_in_gives_zero(ops: ModuleType) -> None:
    case = tiny(points=0, surface_points=0)
    for output in ops.residual_loss(*case):
        assert not output.any()
    assert ops.network_value(*case.network).shape == (0, 5)
    assert ops.strong_residual(*case.strong).shape == (0, 3)
    params = case.params.clone().requires_grad_()
    jet_ = ops.network_jet(case.batch.points, params, *case.network[2:], 1)
    (gradient,) = torch.autograd.grad(jet_.sum(), params)
    assert not gradient.any()


@pytest.mark.parametrize("name", ["params", "theta", *LossPoints._fields, "term_weights"])
@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_not_a_number_is_never_swallowed(form: Form, name: str, ops: ModuleType) -> None:
    """One NaN anywhere shows in the loss: the guard of the training loop looks nowhere else."""
    inputs = operands(tiny(form, source=True))
    inputs[name].view(-1)[-1] = torch.nan
    there = {name: moved(x, device_of(ops)) for name, x in inputs.items()}
    assert torch.ops.granpinn.residual_loss(**there)[0].isnan()
