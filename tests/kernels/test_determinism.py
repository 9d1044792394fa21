"""K-4: the same bits on every repeat, whatever ran in between (CPU: with as many threads)."""

from __future__ import annotations

from types import ModuleType

import pytest
import torch
from torch import Tensor

from .configurations import Configuration, Problem, problem, small

ROWS = [
    small("strong", points=1000, hidden=(64, 64, 64)),
    small("mixed", points=1000, hidden=(64, 64, 64)),
    small("mixed", points=20_001, hidden=(8,), members=2),
]


def outputs(ops: ModuleType, case: Problem) -> list[Tensor]:
    params = case.params.clone().requires_grad_()
    jet = ops.network_jet(case.batch.points, params, *case.network[2:], 2)
    (by_params,) = torch.autograd.grad(jet.square().sum(), params)
    return [jet.detach(), by_params, *ops.residual_loss(*case)]


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize("row", ROWS, ids=str)
def test_same_bits(
    row: Configuration, dtype: torch.dtype, threads: int, cpu_ops: ModuleType
) -> None:
    case = problem(row).to(dtype)
    torch.set_num_threads(threads)
    first = outputs(cpu_ops, case)
    for _ in range(5):
        torch.set_num_threads(3 - threads)  # another count in between leaves no trace
        cpu_ops.residual_loss(*case)
        torch.set_num_threads(threads)
        for a, b in zip(first, outputs(cpu_ops, case), strict=True):
            assert torch.equal(a, b)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize("row", ROWS, ids=str)
def test_same_bits_on_cuda(row: Configuration, dtype: torch.dtype, cuda_ops: ModuleType) -> None:
    """K-4: 250 repeats, with other work on the GPU in between."""
    case, other = problem(row).to(dtype), problem(small("mixed")).to(dtype)
    first = outputs(cuda_ops, case)
    for _ in range(250):
        cuda_ops.residual_loss(*other)
        for a, b in zip(first, outputs(cuda_ops, case), strict=True):
            assert torch.equal(a, b)


@pytest.mark.parametrize("row", ROWS, ids=str)
def test_threads_change_nothing_but_rounding(row: Configuration, cpu_ops: ModuleType) -> None:
    case = problem(row)
    torch.set_num_threads(1)
    one = outputs(cpu_ops, case)
    torch.set_num_threads(2)
    for a, b in zip(one, outputs(cpu_ops, case), strict=True):
        torch.testing.assert_close(a, b, rtol=0, atol=1e-13 * float(a.abs().max()))
