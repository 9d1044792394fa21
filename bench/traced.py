"""Gradients of whole losses as one graph of torch's operations, for the compiler of torch.

torch.compile does not take `torch.autograd.grad` with create_graph. It takes `torch.func`, but then
writes to tensors of zeros that have no memory (pytorch#177261). `make_fx` records the operations of
both instead. Here such zeros become ordinary tensors, equal operations become one, and inductor
compiles the rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor
from torch.fx import GraphModule
from torch.fx.experimental.proxy_tensor import make_fx
from torch.fx.passes.dialect.common.cse_pass import CSEPass

from bench.steps import TENSORS, Task, adam, nested_loss

Gradient = Callable[[Task, Tensor, Tensor], tuple[Tensor, ...]]  # by params and theta; the loss


def nested_gradient(task: Task, params: Tensor, theta: Tensor) -> tuple[Tensor, ...]:
    """Of the loss by nested torch.autograd.grad, as in `bench.steps.eager_step`."""
    params, theta, points = (x.detach().requires_grad_() for x in (params, theta, task.points))
    loss = nested_loss(task, params, theta, points)
    return (*torch.autograd.grad(loss, (params, theta)), loss.detach())


def _zeros(size: list[int], **options: Any) -> Tensor:
    return torch.zeros(size, **options)


def _zeros_of_a_tangent(a: Tensor, b: Tensor, *, self_num_batch_dims: int = 0) -> Tensor:
    return a.new_zeros((*a.shape[:self_num_batch_dims], *b.shape))


ORDINARY_ZEROS: dict[Any, Callable[..., Tensor]] = {
    torch.ops.aten._efficientzerotensor.default: _zeros,
    torch.ops.aten._new_zeros_with_same_feature_meta.default: _zeros_of_a_tangent,
}


def traced(gradient: Gradient, task: Task) -> GraphModule:
    """The graph of (params, theta, points, velocity) -> gradients and loss."""

    def of_tensors(params: Tensor, theta: Tensor, points: Tensor, velocity: Tensor) -> Any:
        return gradient(replace(task, points=points, velocity=velocity), params, theta)

    tensors = [getattr(task, name) for name in TENSORS]
    record: Any = make_fx(of_tensors, decomposition_table=ORDINARY_ZEROS, tracing_mode="fake")
    found: Any = CSEPass()(record(*tensors))
    graph: GraphModule = found.graph_module
    graph.graph.eliminate_dead_code()
    graph.recompile()
    return graph


def traced_step(task: Task, gradient: Gradient) -> Callable[[], Tensor]:
    import torch._inductor

    params, theta, optimizer = adam(task)
    tensors: list[Any] = [params.detach(), theta.detach(), task.points, task.velocity]
    compiled: Any = torch._inductor.compile(traced(gradient, task), tensors)

    def step() -> Tensor:
        loss: Tensor
        params.grad, theta.grad, loss = compiled(*tensors)
        optimizer.step()
        return loss

    return step
