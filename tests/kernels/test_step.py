"""The operators of an optimization step: batches of many members, and errors."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch
from torch import Tensor

from granpinn.kernels import ops
from granpinn.training.objective import INTERIOR, SURFACE
from granpinn.training.optimise import ParameterGroup
from granpinn.training.schedule import HEALTHY

from .step_inputs import (
    MEMBERS,
    SIZES,
    STEP,
    batch_arguments,
    descend_arguments,
    loss_arguments,
    source,
    state,
    update_arguments,
)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_batch_is_what_the_indices_say(dtype: torch.dtype, device: torch.device) -> None:
    arguments, force = batch_arguments(dtype, device), source(dtype, device)
    *found, forces = torch.ops.granpinn.draw_batch(*arguments, 13, 6, force)
    data = [t.cpu() for t in arguments[4:9]]
    for e, (which, seed) in enumerate(MEMBERS):
        begin, surface_begin = (0, 0) if which == 0 else SIZES[0]
        N, M = SIZES[which]
        i = begin + ops.sample_indices(seed, STEP, INTERIOR, 13, N)
        j = surface_begin + ops.sample_indices(seed, STEP, SURFACE, 6, M)
        for drawn, tensor, at in zip(found, data, (i, i, i, j, j), strict=False):
            assert torch.equal(drawn[e].cpu(), tensor[at])
        assert torch.equal(forces[e].cpu(), force.cpu()[i])
    weights = arguments[9].cpu() * torch.tensor([[0.5], [0.25], [2.0]], dtype=dtype).where(
        torch.arange(5) == 0, torch.ones((), dtype=dtype)
    )
    assert torch.equal(found[5].cpu(), weights)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("sizes", [(13, 6), (0, 0)], ids=str)
@pytest.mark.parametrize(("form", "sourced"), [("mixed", False), ("mixed", True), ("data", True)])
def test_the_loss_of_a_batch_is_that_of_what_is_drawn(
    form: str, sourced: bool, sizes: tuple[int, int], dtype: torch.dtype, device: torch.device
) -> None:
    """Bit for bit, also when something has just changed the parameters."""
    arguments = batch_arguments(dtype, device)
    force = (source(dtype, device),) if sourced else ()
    params, theta, *rest, _, law, precision = loss_arguments(len(MEMBERS), dtype, device)
    rest = [*rest, form, law, precision]
    for _ in range(5):
        params.mul_(1.01)
        found = torch.ops.granpinn.batch_loss(*arguments, *sizes, params, theta, *rest, *force)
        *drawn, forces = torch.ops.granpinn.draw_batch(*arguments, *sizes, *force)
        given = (forces,) if sourced else ()
        expected = torch.ops.granpinn.residual_loss(params, theta, *drawn, *rest, *given)
        for a, b in zip(found, expected, strict=True):
            assert torch.equal(a, b)
    assert found[0].isfinite().all()


CALLS = {
    "draw_batch": lambda E, P, dtype: [*batch_arguments(dtype), P, E],
    "batch_loss": lambda E, P, dtype: [
        *batch_arguments(dtype),
        P,
        E,
        *loss_arguments(len(MEMBERS), dtype),
    ],
    "update": update_arguments,
    "descend": descend_arguments,
    "orthogonalize": lambda E, P, dtype: [torch.rand(E, P, 4, dtype=dtype), "fast"],
}


def codes(of_a_member: list[int]) -> torch.Tensor:
    return torch.tensor([of_a_member] * 3)


REFUSED: dict[str, tuple[str, int, Any, str]] = {
    "loss": ("update", 5, torch.rand(3, 1), r"loss must be \[3\] and contiguous, got"),
    "type": ("update", 6, torch.rand(3, 10).double(), "gradient must be Float on cpu, got"),
    "shape": ("update", 8, torch.rand(3, 9), r"first must be \[3, 10\] and contiguous, got"),
    "gaps": ("update", 7, torch.rand(10, 3).T, "params must be .* and contiguous"),
    "members": ("update", 3, torch.zeros(2, dtype=torch.int64), r"fault must be \[3\]"),
    "counter": ("update", 0, torch.zeros(2, dtype=torch.int64), r"counter must be \[3\]"),
    "count": ("update", 0, torch.tensor([0, 0, -1]), "last number of counter must be 0, got -1"),
    "table": ("update", 1, torch.zeros(2, 3).double(), r"table must be \[2, 4\]"),
    "overlap": ("update", 11, [2, 6, 7, 3], "matrices must be ascending and apart"),
    "beyond": ("update", 11, [2, 4, 7, 4], "matrices must end within 10 parameters"),
    "odd": ("update", 11, [2], r"matrices must be \(begin, size\)"),
    "rates": ("update", 19, [0.1], r"adam must be \[learning_rate, beta_1"),
    "variables": ("update", 20, codes([1, 2, 4]), "variables must be in 0..3, got 4"),
    "nothing below": (
        "update",
        20,
        codes([2, 1, 0]),
        "the first parameter of a law has no",
    ),
    "too many": ("update", 20, codes([1] * 11), r"variables must be \[E, 1 to 10\], got \[3, 11\]"),
    "bounds": ("update", 21, torch.zeros(3, 3).double(), r"bounds must be \[3, 3, 2\]"),
    "low bound": ("update", 21, -torch.arange(18.0).double().view(3, 3, 2), "low <= high, got"),
    "theta": ("update", 18, torch.rand(3, 2), r"theta must be \[3, 3\]"),
    "apart": ("descend", 8, 5, "the matrices must lie apart"),
    "matrices": ("descend", 5, torch.rand(2, 2, 2, 3), r"G must be \[3, L, m, n\], got \[2, 2"),
    "of a type": ("descend", 5, torch.rand(3, 2, 2, 3).double(), "G must have the type and device"),
    "precision": ("descend", 10, "half", "precision must be 'fp32' or 'fast', got 'half'"),
    "its precision": ("orthogonalize", 1, "tf32", "precision must be 'fp32' or 'fast', got 'tf32'"),
    "stack": ("orthogonalize", 0, torch.rand(3), r"G must be \[..., m, n\], got \[3\]"),
    "no points": ("draw_batch", 4, torch.rand(0, 3), r"velocity must be \[0, 2\]"),
    "integers": ("draw_batch", 2, torch.zeros(3), "seeds must be Long on cpu, got"),
    "negative": ("draw_batch", 11, -1, r"must be in \[0, 2\^32\], got"),
    "too large": ("draw_batch", 10, 2**33, r"must be in \[0, 2\^32\], got"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_arguments_are_refused_by_name(case: str) -> None:
    name, index, value, message = REFUSED[case]
    arguments = CALLS[name](3, 10, torch.float32)
    arguments[index] = value
    with pytest.raises((ValueError, TypeError), match=message):
        getattr(torch.ops.granpinn, name)(*arguments)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("P", [1001, 60_001], ids=["few", "many"])
def test_update_on_the_gpu_is_that_on_the_cpu(
    P: int, dtype: torch.dtype, cuda_ops: ModuleType
) -> None:
    """Of few parameters and of many, but for rounding, and bit for bit again; one has a fault."""
    arguments = update_arguments(3, P, dtype)
    arguments[6][1, -1] = torch.nan
    arguments[2][2] = 0.5

    def updated(device: str) -> list[Tensor]:
        copies = [a.to(device, copy=True) if isinstance(a, Tensor) else a for a in arguments]
        for _ in range(3):
            torch.ops.granpinn.update(*copies)
        return [a.cpu() for a in copies if isinstance(a, Tensor)]

    found, sound = updated("cuda"), torch.tensor([0, 2])
    for a, b in zip(found, updated("cuda"), strict=True):
        assert torch.equal(a.nan_to_num(), b.nan_to_num())
    for a, b in zip(found[4:], updated("cpu")[4:], strict=True):
        rtol = 32 * torch.finfo(dtype).eps
        torch.testing.assert_close(a[sound], b[sound], rtol=rtol, atol=rtol)
    assert found[0].tolist() == [3, 0, 0]
    assert found[3].tolist() == [HEALTHY, 1, HEALTHY]
    assert found[4][:, 0].tolist() == [3, 1, 3]


@pytest.mark.parametrize("precision", ["fp32", "fast"])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("shape", [(2, 20, 30), (1, 128, 128), (3, 90, 33), (2, 40, 129)], ids=str)
def test_descend_subtracts_the_orthogonal_factor(
    shape: tuple[int, int, int], dtype: torch.dtype, precision: str, device: torch.device
) -> None:
    """Of sound members, from the matrices alone, at each one's own rate; and bit for bit again."""
    group, E = ParameterGroup(5, *shape), 3
    P = group.offset + group.count * group.apart + 7
    direction, params = (torch.randn(E, P, dtype=dtype, device=device) for _ in range(2))
    counter, table, lr_scale, fault, counts = state(E, str(device))
    table[:, 0], lr_scale[0], fault[1], counter[0] = 0.5, 0.25, 0, 1
    expected = params.to(torch.float64, copy=True)
    U = torch.ops.granpinn.orthogonalize(group.of(direction), precision).double()
    rates = 0.1 * 0.5 * torch.tensor([0.25, 0.0, 1.0], dtype=torch.float64, device=device)
    group.of(expected).sub_(rates[:, None, None, None] * U)

    def descend(start: Tensor) -> Tensor:
        now = start.clone()
        places = (group.offset, group.apart, 0.1, precision)
        G = group.of(direction)
        steered = (counter, table, lr_scale, fault, counts)
        torch.ops.granpinn.descend(*steered, G, now, *places)
        return now

    found = descend(params)
    atol = 4 * torch.finfo(dtype).eps * float(params.abs().max())
    torch.testing.assert_close(found.double(), expected, rtol=0, atol=atol)
    assert torch.equal(found[1], params[1])
    still = torch.ones_like(params)
    group.of(still).zero_()
    assert torch.equal(found * still, params * still)
    assert torch.equal(found, descend(params))
    assert fault.tolist() == [HEALTHY, 0, HEALTHY]
    params[2, group.offset] = torch.inf
    counter[0] = 5
    assert torch.equal(descend(params)[:2], found[:2])
    assert fault.tolist() == [HEALTHY, 0, 4 * 8 + 3]
