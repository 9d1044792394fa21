"""Tests for the GPU only: capture in a graph, and the limits of networks and tensors."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
import torch
from torch import Tensor

from .configurations import Problem, problem, small
from .devices import moved
from .op_inputs import LAW, flow, jet_backward, operands, raw_jets
from .step_inputs import update_arguments

ops_ = torch.ops.granpinn


def on_gpu(arguments: tuple[Any, ...]) -> list[Any]:
    return [moved(x, "cuda") for x in arguments]


@pytest.mark.parametrize("form", ["mixed", "strong", "data"])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_loss_in_a_cuda_graph(form: str, dtype: torch.dtype, cuda_ops: ModuleType) -> None:
    """No op waits for the GPU or reads the CPU's memory; a replay has the bits of a direct call."""
    cases = [
        problem(small("strong" if form == "strong" else "mixed", points=700, members=2), draw)
        for draw in (0, 1)
    ]
    arguments, others = (
        on_gpu(tuple(operands(case.to(dtype), equations=form != "data").values())) for case in cases
    )
    captured = replayed(lambda: ops_.residual_loss(*arguments), arguments, others)
    for a, b in zip(captured, ops_.residual_loss(*others), strict=True):
        assert torch.equal(a, b)


def test_the_other_ops_in_a_cuda_graph(cuda_ops: ModuleType) -> None:
    case: Problem = problem(small("mixed"))
    jet, backward = on_gpu((*case.network, 2)), on_gpu(jet_backward(case, 2))
    viscosity, residuals = on_gpu(flow(50)), on_gpu(raw_jets("mixed", 50, 5))
    step, later = torch.tensor(3, device="cuda"), torch.tensor(4, device="cuda")

    def everything() -> list[Tensor]:
        return [
            ops_.network_jet(*jet),
            ops_.network_jet_backward(*backward),
            ops_.viscosity(*viscosity),
            *ops_.viscosity_backward(viscosity[0], *viscosity),
            ops_.pointwise_residuals(*residuals),
            ops_.sample_indices(step, 1, 0, 100, 1000),
        ]

    captured = replayed(everything, [step], [later])
    assert torch.equal(captured[-1], ops_.sample_indices(later, 1, 0, 100, 1000))
    for a, b in zip(captured, everything(), strict=True):
        assert torch.equal(a, b)


def replayed(work: Any, arguments: list[Any], others: list[Any]) -> Any:
    """The outputs of `work`, captured with `arguments` and replayed after these became `others`."""
    side = torch.cuda.Stream()
    side.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(side):
        work()
    torch.cuda.current_stream().wait_stream(side)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        outputs = work()
    for x, y in zip(arguments, others, strict=True):
        if isinstance(x, Tensor):
            x.copy_(y)
    graph.replay()
    torch.cuda.synchronize()
    return outputs


def test_many_points_and_members_go_in_chunks(cuda_ops: ModuleType, cpu_ops: ModuleType) -> None:
    """More points than a chunk of the layered path, more members than a group."""
    case = problem(small("mixed", points=40_001, surface_points=20_001, members=24))
    for a, b in zip(cuda_ops.residual_loss(*case), cpu_ops.residual_loss(*case), strict=True):
        torch.testing.assert_close(a, b, rtol=1e-9, atol=1e-11 * float(b.abs().max()))


def test_a_tensor_that_was_left_on_the_cpu(cuda_ops: ModuleType) -> None:
    case = problem(small("mixed"))
    there = {name: moved(x, "cuda") for name, x in operands(case).items()}
    with pytest.raises(TypeError, match=r"theta must have the type and device of params.*cuda"):
        ops_.residual_loss(**there | {"theta": case.theta})


def test_strided_input_on_cuda(cuda_ops: ModuleType) -> None:
    gamma_dot, p, theta = flow(64)[:3]
    direct = ops_.viscosity(*on_gpu((gamma_dot, p, theta)), "mu_of_i", *LAW)
    wide = torch.stack([gamma_dot, p], -1).cuda()
    assert torch.equal(
        ops_.viscosity(wide[:, 0], wide[:, 1], theta.cuda(), "mu_of_i", *LAW), direct
    )


def test_a_wrong_count_of_blocks_delays_a_step_and_no_more(cuda_ops: ModuleType) -> None:
    """The block that waits for the others gives up after seconds; the step is the right one."""
    found = []
    for count in (0, -3):
        torch.manual_seed(0)
        arguments = update_arguments(2, 5000, torch.float32)
        arguments[0][2] = count
        arguments = [moved(x, "cuda") for x in arguments]
        torch.ops.granpinn.update(*arguments)
        assert arguments[0].tolist() == [1, 0, 0]
        found.append([x for x in arguments if isinstance(x, torch.Tensor)])
    assert all(torch.equal(*pair) for pair in zip(*found, strict=True))
