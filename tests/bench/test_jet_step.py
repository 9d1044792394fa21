"""The rivals of the fused jets compute the same gradient."""

from __future__ import annotations

import pytest
import torch

from bench import jet_step


def test_each_way_gives_the_same_gradient(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = jet_step.steps()
    expected = steps["nested"]()
    for name in ("fused", "by hand"):
        found = steps[name]()
        assert float((found - expected).norm() / expected.norm()) < 1e-4, name
    monkeypatch.setattr(jet_step, "ROUNDS", 3)
    assert jet_step.milliseconds(steps["fused"]) < jet_step.milliseconds(steps["nested"])


def test_second_derivatives_by_hand_are_in_the_units_of_the_points() -> None:
    net = jet_step.SwishNetwork(2, (5, 4), (0, 1, -2), (3, 2, 5), seed=2).double()
    where = torch.rand(6, 3, dtype=torch.float64)
    for found, expected in zip(jet_step.by_hand(net, where), net.jet(where), strict=True):
        torch.testing.assert_close(found, expected)
