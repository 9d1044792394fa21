"""Collocation points between the highest vectors and the free surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from granpinn.data import Flow
from granpinn.data.collocation import DENSITY, FINER, LARGEST_PART
from granpinn.data.flow import Surface
from granpinn.data.scaling import scales_of
from granpinn.data.symmetry import axes_of
from granpinn.training.points import TrainingSet, training_set
from tests.data.walled import line
from tests.flows import make_chute

GAP = 1.4  # spacings between the centers of the highest cells and the line


def layer(gap: float = GAP, frames: int = 3) -> Flow:
    """A chute whose surface lies at a distance of its highest vectors."""
    flow = make_chute(frames=frames, columns=120)
    spacing = flow.y[1] - flow.y[0]
    top = flow.y[np.flatnonzero(flow.valid.any(axis=(0, 2)))[-1]]
    t, x = (a.ravel() for a in np.meshgrid(flow.t, flow.x, indexing="ij"))
    return replace(flow, surface=Surface(t, x, np.full(t.size, top + gap * spacing), None))


def trained(flow: Flow, share: float = 1.0, level: str = "V1") -> TrainingSet:
    return training_set(flow, scales_of(flow), level, torch.float32, share)


@pytest.mark.parametrize("frames", [1, 3])
def test_they_fill_the_strip_evenly(frames: int) -> None:
    flow = layer(frames=frames)
    before = trained(flow)
    found = trained(flow).strip.double().numpy()
    top = before.points[:, 1].max().item()
    height = (found[:, 1] - top) / (before.surface_points[:, 1].max().item() - top)
    assert np.histogram(height, 4, (0, 1))[0] == pytest.approx(
        len(found) / 4, abs=4 * len(found) ** 0.5 / 2
    )
    columns = flow.valid.any(axis=(0, 1)).sum()
    per_cell = DENSITY * len(before.between) / len(before.points)
    expected = per_cell * frames * columns * GAP
    most = LARGEST_PART * (len(before.points) + len(before.between))
    assert len(found) == pytest.approx(min(FINER * expected, most), rel=0.15)
    assert len(np.unique(found[:, 2])) == frames
    made = trained(flow)
    of_between, of_strip = made.equation_weights.split([len(made.between), len(made.strip)])
    assert (of_strip.sum() / of_between[0]).item() == pytest.approx(expected, rel=0.15)


def test_the_rest_of_the_training_stays() -> None:
    """The weights of the equations have another mean over the data, the same at all of them."""
    flow = layer()
    before, after = trained(flow, level="V0"), trained(flow)
    assert len(after.equation_weights) == len(after.between) + len(after.strip)
    made = after.arrays()
    for name, values in before.arrays().items():
        if name == "point_weights":
            assert torch.equal(made[name][:, 0], values[:, 0])
            assert len(made[name][:, 1].unique()) == 1
        elif name not in ("strip", "equation_weights", "surface_points", "surface_pressure"):
            assert torch.equal(made[name], values)


def test_the_pool_holds_them_between_the_others_and_the_walls() -> None:
    flow = layer()
    walls = replace(line((-8, 0), (40, 0)), slip=np.zeros(2, np.float32))
    flow = replace(flow, walls=walls)
    data = trained(flow)
    pool = data.pooled()
    parts = data.points, data.between, data.strip, data.wall_points
    assert all(len(part) > 0 for part in parts)
    assert torch.equal(pool.points, torch.cat(parts))
    N, B, S, W = map(len, parts)
    of_strip = (data.equation_weights[-1] / data.equation_weights[0]).item()
    assert of_strip < 1
    holds = [[1, 1], [0, 1], [0, of_strip], [1, 0]]
    of_part = torch.tensor([[1 / N, 1 / (N + B + S * of_strip)]]) * (N + B + S + W)
    for part, own in zip(pool.point_weights.split([N, B, S, W]), holds, strict=True):
        torch.testing.assert_close(part, of_part.expand(len(part), 2) * torch.tensor(own))
    assert pool.pooled() is pool


@pytest.mark.parametrize("steady", [True, False])
def test_the_time_of_a_line_counts_unless_the_flow_is_steady(steady: bool) -> None:
    flow = layer()
    if not steady:
        flow = replace(flow, attributes={"period_x": 32.0})
    assert flow.surface is not None
    between = (flow.t[1] + flow.t[2]) / 2  # no vector has this time
    late = replace(flow.surface, t=np.where(flow.surface.t > flow.t[1], between, flow.surface.t))
    flow = replace(flow, surface=late)
    found = trained(flow).strip
    assert len(found[:, 2].unique()) == (3 if steady else 2)


@pytest.mark.parametrize("periodic", [True, False])
def test_no_strip_lies_behind_a_wall(periodic: bool) -> None:
    """A lid over the left half: the line above it is that of other grains."""
    flow = layer()
    flow = flow if periodic else replace(flow, attributes={"steady": 1})
    assert flow.surface is not None
    height, middle = flow.surface.y[0] - 0.1 * (flow.y[1] - flow.y[0]), flow.x.mean()
    lid = replace(flow, walls=line((flow.x[0] - 1, height), (middle, height)))
    scales = scales_of(flow)

    def strip(flow: Flow) -> tuple[np.ndarray, np.ndarray]:
        """x of its points, and their weights relative to those of the points between."""
        made = trained(flow)
        found = made.strip.double()
        x, y = axes_of(flow).undo(found[:, 0], found[:, 1])
        place = scales.points_to_physical(np.stack([x, y, found[:, 2]], 1))[:, 0]
        weights = (made.equation_weights / made.equation_weights[0]).numpy()
        return place, weights[len(made.between) :]

    (free, weights), (beside, of_beside) = strip(flow), strip(lid)
    assert beside.min() > middle - 1.5 * (flow.x[1] - flow.x[0])
    assert of_beside.sum() == pytest.approx(weights[free > middle].sum(), rel=0.2)
    assert weights[free < middle].sum() > of_beside.sum() / 2
