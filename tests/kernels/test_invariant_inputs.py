"""An input with the factor 0 has no effect at all: every derivative by it is exactly 0."""

from __future__ import annotations

import pytest
import torch

from granpinn import reference
from granpinn.kernels import ops

from .configurations import Form, problem, small

FORMS = ("strong", "mixed")


@pytest.mark.parametrize("without", [(2,), (0,), (0, 2)])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_derivatives_by_an_invariant_input(
    form: Form, without: tuple[int, ...], dtype: torch.dtype, device: torch.device
) -> None:
    case = problem(small(form))
    params, points = case.loss[0], case.loss[2]
    widths, shift, scale = case.loss[8:11]
    factors = [0.0 if k in without else float(f) for k, f in enumerate(scale)]
    network = (widths, [float(s) for s in shift], factors)
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
    case = problem(small(form))
    loss = [a.to(device) if isinstance(a, torch.Tensor) else a for a in case.loss]
    loss[10] = torch.as_tensor(loss[10]).to(loss[0]).clone()
    loss[10][2] = 0.0
    found = ops.residual_loss(*loss)
    moved = list(loss)
    for k in (2, 5):
        moved[k] = loss[k].clone()
        moved[k][:, 2] += 0.7
    for ours, other in zip(found, ops.residual_loss(*moved), strict=True):
        assert torch.equal(ours, other)
    first = found[2][: 3 * loss[8][1]].view(-1, 3)  # of W in the first layer
    assert (first[:, 2] == 0).all()
    assert (first[:, :2] != 0).any()
