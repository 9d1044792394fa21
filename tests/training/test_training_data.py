"""Equations between the vectors are asked for where the vectors are exact, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from granpinn.data import Flow, add_noise, training_set
from granpinn.identification.training_data import EXACT, is_exact, training_data
from granpinn.scales import Scales
from tests.data.test_particles import scattered
from tests.training.conftest import tiny


def with_unstated_noise(flow: Flow, sigma: float) -> Flow:
    """Noise of so many sqrt(g H0) that the file does not tell of."""
    scales = Scales.from_flow(flow)
    rng = np.random.default_rng(3)
    u, v = (
        (values + sigma * scales.velocity * rng.standard_normal(values.shape)).astype(np.float32)
        for values in (flow.u, flow.v)
    )
    return replace(flow, u=u, v=v)


def test_exact_vectors_have_points_between_them(flow: Flow) -> None:
    data = training_data(flow, Scales.from_flow(flow), tiny())
    assert len(data.between) == len(data.points)
    assert data.between.dtype == torch.float32


@pytest.mark.parametrize(
    ("name", "exact"),
    [("stated", False), ("far below", True), ("above", False), ("particles", False)],
)
def test_measured_vectors_have_none(flow: Flow, name: str, exact: bool) -> None:
    seen = {
        "stated": lambda: add_noise(flow, 1e-6, 0),
        "far below": lambda: with_unstated_noise(flow, EXACT / 10),
        "above": lambda: with_unstated_noise(flow, 3 * EXACT),
        "particles": lambda: scattered(flow),
    }[name]()
    scales = Scales.from_flow(seen)
    assert is_exact(seen, scales) == exact
    data = training_data(seen, scales, tiny())
    assert (len(data.between) > 0) == exact
    if not exact:
        assert torch.equal(data.point_weights, training_set(seen, scales).point_weights)


def test_too_few_frames_tell_nothing(flow: Flow) -> None:
    c, u, v = flow.c[:3], flow.u[:3], flow.v[:3]
    short = replace(flow, t=flow.t[:3], c=c, u=u, v=v, p=None, surface=None)
    few = replace(short, c=np.where(np.arange(flow.x.size) < 2, c, 0).astype(np.float32))
    assert not is_exact(few, Scales.from_flow(few))


def test_they_can_be_left_out(flow: Flow) -> None:
    config = tiny(batch__collocation=0.0)
    assert len(training_data(flow, Scales.from_flow(flow), config).between) == 0
