"""Collocation points between the measured vectors."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import numpy.typing as npt
import pytest
import torch

from granpinn.data import Flow
from granpinn.data.collocation import above_ground
from granpinn.data.scaling import scales_of
from granpinn.training.points import TrainingSet, training_set
from tests.flows import make_flow
from tests.training.test_points import FLOW, SCALES, with_gaps


def collocated(flow: Flow, share: float, dtype: torch.dtype = torch.float64) -> TrainingSet:
    return training_set(flow, scales_of(flow), "V0", dtype, share)


def cells_of(flow: Flow, points: torch.Tensor) -> npt.NDArray[np.int64]:
    """Frame, row and column [B, 3] below the points, from their places in the units of the file."""
    x, y, t = SCALES.points_to_physical(points).T
    edges = ((t, flow.t), (y, flow.y), (x, flow.x))
    return np.stack([np.searchsorted(own, values, "right") - 1 for values, own in edges], 1)


@pytest.mark.parametrize("flow", [FLOW, with_gaps(FLOW)], ids=["full", "gaps"])
def test_they_lie_in_cells_full_of_grains_above_the_lowest_row(flow: Flow) -> None:
    data = collocated(flow, 3.0)
    assert len(data.between) == 3 * len(data.points)
    cells = cells_of(flow, data.between)
    for corner in product((0, 1), repeat=3):
        assert flow.material[tuple((cells + corner).T)].all()
    assert cells[:, 1].min() == 1
    grains = flow.material[:, 1:]
    for axis in range(3):
        grains = np.delete(grains, 0, axis) & np.delete(grains, -1, axis)
    assert len(np.unique(cells, axis=0)) > 0.9 * grains.sum()


def test_they_fill_their_cells() -> None:
    flow = make_flow(frames=40, rows=80, columns=60)
    cells = cells_of(flow, points := collocated(flow, 2.0).between)
    x, y, t = SCALES.points_to_physical(points).T
    for values, edges, k in zip((t, y, x), (flow.t, flow.y, flow.x), cells.T, strict=True):
        part = (values - edges[k]) / (edges[k + 1] - edges[k])
        assert np.histogram(part, 5, (0, 1))[0] == pytest.approx(len(points) / 5, rel=0.05)


def test_the_lowest_row_has_no_points_above_it() -> None:
    c = np.zeros((3, 24, 20), np.float32)
    c[:, 2:22, 2:18] = 1
    grains = replace(FLOW, t=np.arange(1.0, 4), c=c)
    removed = np.argwhere(grains.material & ~above_ground(grains))
    assert set(removed[:, 1]) == {2}
    assert len(removed) == c.sum() / 20


def test_pooled_weights_keep_the_mean_over_the_data() -> None:
    data = collocated(FLOW, 0.5)
    pool, N, B = data.pooled(), len(data.points), len(data.between)
    assert len(pool.points) == len(pool.velocity) == len(pool.point_weights) == N + B
    assert torch.equal(pool.points, torch.cat([data.points, data.between]))
    assert not pool.point_weights[N:, 0].any()
    assert torch.equal(
        pool.point_weights[:, 1], torch.cat([data.point_weights[:, 1], torch.ones(B)])
    )
    before = (data.point_weights[:, :1] * data.velocity**2).mean()
    after = (pool.point_weights[:, :1] * pool.velocity**2).mean()
    assert float(after) == pytest.approx(float(before), rel=1e-12)
    assert pool.pooled() is pool
