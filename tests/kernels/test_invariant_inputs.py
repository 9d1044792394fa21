"""An input with the factor 0 has no effect at all: every derivative by it is exactly 0."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor
from torch.utils._pytree import tree_map_only

from granpinn import reference
from granpinn.kernels import ops

from .configurations import Form, Problem, problem, small

FORMS = ("strong", "mixed")


@pytest.mark.parametrize("without", [(2,), (0,), (0, 2)])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_derivatives_by_an_invariant_input(
    form: Form, without: tuple[int, ...], dtype: torch.dtype, device: torch.device
) -> None:
    case = problem(small(form))
    points, params, widths, shift, scale = case.network
    factors = [0.0 if k in without else f for k, f in enumerate(scale)]
    network = (widths, shift, factors)
    arguments = [a.to(device, dtype) for a in (points, params)]
    jet = ops.network_jet(*arguments, *network, 2)
    expected = reference.network_jet(points, params, *network, 2)
    seconds = {0: 4, 1: 6}  # of the jet: value, x, y, t, xx, xy, yy
    for k in without:
        assert (jet[1 + k] == 0).all()
        assert (expected[1 + k] == 0).all()
        if k in seconds:
            assert (jet[seconds[k]] == 0).all()
    moved = arguments[0].clone()
    moved[:, list(without)] += 0.3
    assert torch.equal(ops.network_jet(moved, arguments[1], *network, 2), jet)
    close = {torch.float32: 1e-3, torch.float64: 1e-10}[dtype]
    torch.testing.assert_close(jet.double().cpu(), expected, rtol=close, atol=close)


@pytest.mark.parametrize("form", FORMS)
def test_the_loss_does_not_depend_on_an_invariant_input(form: Form, device: torch.device) -> None:
    """Nor does its gradient by the weights of this input differ from 0."""
    case: Problem = tree_map_only(Tensor, lambda x: x.to(device), problem(small(form)))
    case = case._replace(spec=replace(case.spec, input_scale=(*case.spec.input_scale[:2], 0.0)))
    found = ops.residual_loss(*case)
    later = case.params.new_tensor([0.0, 0.0, 0.7])
    points, surface_points = case.batch.points + later, case.batch.surface_points + later
    batch = case.batch._replace(points=points, surface_points=surface_points)
    for ours, other in zip(found, ops.residual_loss(*case._replace(batch=batch)), strict=True):
        assert torch.equal(ours, other)
    first = found[2][: 3 * case.spec.widths[1]].view(-1, 3)  # of W in the first layer
    assert (first[:, 2] == 0).all()
    assert (first[:, :2] != 0).any()
