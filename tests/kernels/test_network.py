"""The flat parameter vector: its layout and its start."""

from __future__ import annotations

import math

import pytest
import torch

from granpinn.kernels import ops
from granpinn.kernels.network import NetworkSpec, initial_parameters, views

SPEC = NetworkSpec((3, 40, 50, 5), (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), "mixed")


def test_views_are_the_layout_of_the_kernels() -> None:
    params = initial_parameters(SPEC, seed=1)
    points = torch.rand(7, 3, dtype=torch.float64)
    a = (points - torch.tensor(SPEC.input_shift)) * torch.tensor(SPEC.input_scale)
    for layer, (W, b) in enumerate(views(params, SPEC.widths)):
        a = (a if layer == 0 else a * torch.sigmoid(a)) @ W.T + b
    z = ops.network_value(points, params, SPEC.widths, SPEC.input_shift, SPEC.input_scale)
    torch.testing.assert_close(z, a, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("distribution", ["wide", "glorot_uniform"])
def test_the_start_is_a_function_of_the_seed(distribution: str) -> None:
    first = initial_parameters(SPEC, 3, distribution)
    torch.rand(5)
    assert torch.equal(first, initial_parameters(SPEC, 3, distribution))
    assert not torch.equal(first, initial_parameters(SPEC, 4, distribution))


def test_the_start_has_the_spread_that_it_says() -> None:
    (W_0, b_0), (W_1, b_1), (W_2, b_2) = views(initial_parameters(SPEC, 0), SPEC.widths)
    assert W_0.std() == pytest.approx(1, rel=0.2)
    assert b_0.abs().max() <= 1
    assert W_1.std() == pytest.approx(1.4 / math.sqrt(40), rel=0.1)
    assert W_2[:2].std() == pytest.approx(1 / math.sqrt(50), rel=0.3)
    assert W_2[2:].std() == pytest.approx(0.3 / math.sqrt(50), rel=0.3)
    assert not b_1.any()
    assert not b_2.any()
    for W, b in views(initial_parameters(SPEC, 0, "glorot_uniform"), SPEC.widths):
        assert W.std() == pytest.approx(math.sqrt(2 / sum(W.shape)), rel=0.2)
        assert not b.any()
