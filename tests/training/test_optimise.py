"""The optimizer against torch's own, on the same gradients."""

from __future__ import annotations

from typing import Any

import pytest
import torch

from granpinn.config import Optimizer
from granpinn.network import n_params, views
from granpinn.optimise import FlatOptimizer, average_into, orthogonalized

WIDTHS = (3, 20, 30, 25, 5)


def make(method: str, **changes: Any) -> tuple[torch.Tensor, torch.Tensor, FlatOptimizer]:
    params = torch.randn(n_params(WIDTHS), dtype=torch.float64)
    scalars = torch.randn(2, dtype=torch.float64)
    return (
        params,
        scalars,
        FlatOptimizer(params, scalars, WIDTHS, Optimizer(method=method, **changes)),
    )  # type: ignore[arg-type]


def gradients(step: int) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(step)
    draw = torch.randn(n_params(WIDTHS) + 2, dtype=torch.float64, generator=generator)
    return draw[:-2], draw[-2:]


def test_adam_is_the_adam_of_torch() -> None:
    params, scalars, optimizer = make("adam", learning_rate=1e-3, scalars_learning_rate=1e-2)
    leaves = [params.clone().requires_grad_(), scalars.clone().requires_grad_()]
    rival = torch.optim.Adam(
        [{"params": [leaves[0]], "lr": 1e-3}, {"params": [leaves[1]], "lr": 1e-2}],
        betas=(0.9, optimizer.settings.beta_2),
    )
    for step in range(10):
        grads = gradients(step)
        optimizer.step(*grads, factor=1.0)
        leaves[0].grad, leaves[1].grad = grads
        rival.step()
    torch.testing.assert_close(params, leaves[0].detach())
    torch.testing.assert_close(scalars, leaves[1].detach())


def test_muon_is_the_muon_of_torch_up_to_its_bfloat16() -> None:
    params, _, optimizer = make("muon", muon_learning_rate=0.02, momentum=0.9)
    start = params.clone()
    leaves = [W.clone().requires_grad_() for W, _ in views(params, WIDTHS)[1:-1]]
    rival = torch.optim.Muon(leaves, lr=0.02, momentum=0.9, weight_decay=0.0)
    for step in range(5):
        grads = gradients(step)
        optimizer.step(*grads, factor=1.0)
        for leaf, (G, _) in zip(leaves, views(grads[0], WIDTHS)[1:-1], strict=True):
            leaf.grad = G
        rival.step()
    moved = [W for W, _ in views(params - start, WIDTHS)[1:-1]]
    expected = [
        leaf.detach() - W for leaf, (W, _) in zip(leaves, views(start, WIDTHS)[1:-1], strict=True)
    ]
    for ours, theirs in zip(moved, expected, strict=True):
        assert (ours - theirs).norm() < 0.05 * theirs.norm()


def test_muon_leaves_the_first_and_last_layer_and_the_biases_to_adam() -> None:
    params, _, optimizer = make("muon")
    rest = params.clone()
    adam = FlatOptimizer(rest, torch.zeros(2, dtype=torch.float64), WIDTHS, Optimizer("adam"))
    grads = gradients(0)
    optimizer.step(*grads, factor=0.5)
    adam.step(*grads, factor=0.5)
    ours, theirs = views(params, WIDTHS), views(rest, WIDTHS)
    for layer in range(4):
        assert torch.equal(ours[layer][1], theirs[layer][1])
        assert torch.equal(ours[layer][0], theirs[layer][0]) is (layer in (0, 3))


@pytest.mark.parametrize("shape", [(30, 30), (20, 50), (50, 20)])
def test_newton_schulz_makes_singular_values_about_one(shape: tuple[int, int]) -> None:
    X = orthogonalized(torch.randn(shape, dtype=torch.float64))
    values = torch.linalg.svdvals(X)
    assert X.shape == shape
    assert values.max() < 1.3
    assert values.median() > 0.6


def test_newton_schulz_of_zero_is_zero() -> None:
    assert not orthogonalized(torch.zeros(4, 4)).any()


@pytest.mark.parametrize("method", ["adam", "muon"])
def test_its_tensors_are_its_whole_state(method: str) -> None:
    params, scalars, optimizer = make(method)
    optimizer.step(*gradients(0), factor=1.0)
    twin_params, twin_scalars, twin = make(method)
    twin_params.copy_(params)
    twin_scalars.copy_(scalars)
    for name, tensor in twin.tensors().items():
        tensor.copy_(optimizer.tensors()[name])
    for step in (1, 2):
        optimizer.step(*gradients(step), factor=0.7)
        twin.step(*gradients(step), factor=0.7)
    assert torch.equal(params, twin_params)
    assert torch.equal(scalars, twin_scalars)


def test_reset_is_a_new_optimizer() -> None:
    params, scalars, optimizer = make("muon")
    optimizer.step(*gradients(0), factor=1.0)
    optimizer.reset()
    fresh_params, fresh_scalars = params.clone(), scalars.clone()
    fresh = FlatOptimizer(fresh_params, fresh_scalars, WIDTHS, optimizer.settings)
    optimizer.step(*gradients(1), factor=1.0)
    fresh.step(*gradients(1), factor=1.0)
    assert torch.equal(params, fresh_params)
    assert torch.equal(scalars, fresh_scalars)


def test_scalars_without_a_gradient_stay() -> None:
    _, scalars, optimizer = make("muon")
    before = scalars.clone()
    optimizer.step(gradients(0)[0], None, factor=1.0)
    assert torch.equal(scalars, before)


def test_the_average_is_the_mean() -> None:
    values = torch.randn(5, 3, dtype=torch.float64)
    average = torch.zeros(3, dtype=torch.float64)
    for count, value in enumerate(values, start=1):
        average_into(average, value, count)
    torch.testing.assert_close(average, values.mean(0))
