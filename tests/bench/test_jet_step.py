"""The rivals of the fused jets compute the same gradient."""

from __future__ import annotations

import pytest
import torch

from bench import jet_step
from granpinn.kernels import ops
from granpinn.kernels.network import drawn_parameters


def test_each_way_gives_the_same_gradient(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = jet_step.steps()
    expected = steps["nested"]()
    for name in ("fused", "by hand"):
        found = steps[name]()
        assert float((found - expected).norm() / expected.norm()) < 1e-4, name
    monkeypatch.setattr(jet_step, "ROUNDS", 3)
    assert jet_step.milliseconds(steps["fused"]) < jet_step.milliseconds(steps["nested"])


def test_second_derivatives_by_hand_are_in_the_units_of_the_points() -> None:
    network = [3, 5, 4, 2], [1.5, 1.5, 1.5], [2 / 3, 2.0, 2 / 7]
    params, where = drawn_parameters(network[0], 2), torch.rand(6, 3, dtype=torch.float64)
    expected = ops.network_jet(where, params, *network, 2)
    torch.testing.assert_close(torch.stack(jet_step.by_hand(params, where, *network)), expected)
