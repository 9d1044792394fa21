"""Training set, surface set and test grid: which points, in which order, in which units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from granpinn.data import Flow, FlowFileError
from granpinn.data.outline import outline
from granpinn.data.scaling import RESOLUTION, scales_of
from granpinn.training.points import training_set
from tests.flows import make_flow

FLOW = make_flow()

SCALES = scales_of(FLOW)

SURFACE = FLOW.surface
assert SURFACE is not None
assert SURFACE.p is not None


def with_gaps(flow: Flow) -> Flow:
    u, v = flow.u.copy(), flow.v.copy()
    gaps = np.arange(u.size).reshape(u.shape) % 7 == 0
    u[gaps] = v[gaps] = np.nan
    return replace(flow, u=u, v=v)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_data_points_are_the_valid_vectors_in_order(dtype: torch.dtype) -> None:
    flow = with_gaps(FLOW)
    data_set = training_set(flow, SCALES, "V1", dtype)
    expected = [
        (flow.x[k], flow.y[j], flow.t[i], flow.u[i, j, k], flow.v[i, j, k])
        for i, j, k in np.ndindex(flow.u.shape)
        if flow.c[i, j, k] == 1 and np.isfinite(flow.u[i, j, k])
    ]
    found = np.concatenate(
        [
            SCALES.points_to_physical(data_set.points),
            SCALES.to_physical(data_set.velocity.numpy(), "velocity"),
        ],
        axis=1,
    )
    rounding = RESOLUTION * max(SCALES.length, SCALES.time, SCALES.velocity)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=rounding)
    tensors = [value for value in vars(data_set).values() if isinstance(value, torch.Tensor)]
    assert {tensor.dtype for tensor in tensors} == {dtype}


def test_no_time_zero() -> None:
    early = replace(FLOW, t=FLOW.t - FLOW.t[2], surface=replace(SURFACE, t=SURFACE.t - FLOW.t[2]))
    data_set = training_set(early, SCALES, "V2")
    assert data_set.points[:, 2].min() > 0
    assert data_set.surface_points[:, 2].min() > 0
    assert len(data_set.points) == FLOW.valid[3:].sum()
    with pytest.raises(FlowFileError, match="vectors at t > 0, on a grid"):
        training_set(replace(FLOW, t=FLOW.t - 9), SCALES)


def test_levels() -> None:
    v0, v1, v2 = (training_set(FLOW, SCALES, level) for level in ("V0", "V1", "V2"))
    assert torch.equal(v0.surface_pressure, torch.zeros(len(v0.surface_points)))
    above_toe = SURFACE.y > SURFACE.y.min() + 2 * FLOW.grain_diameter
    assert 0 < above_toe.sum() < len(SURFACE.y)
    assert len(v1.surface_points) == above_toe.sum()
    np.testing.assert_allclose(
        SCALES.points_to_physical(v1.surface_points),
        np.stack([SURFACE.x, SURFACE.y, SURFACE.t], -1)[above_toe],
        rtol=1e-6,
    )
    assert torch.equal(v1.surface_pressure, torch.zeros(len(v1.surface_points)))
    assert len(v2.surface_points) == len(SURFACE.y)


def test_the_outline_is_the_surface_to_a_spacing() -> None:
    radius = 0.6 * (1 + 2 * FLOW.t[:, None, None] ** 2)
    surface = np.sqrt(np.maximum(0, 1 - (FLOW.x / radius) ** 2)) / (radius / 0.6)
    grains = FLOW.y[:, None] < surface
    grains[3, -1, 4] = True  # grains up to the edge of what was seen
    found = outline(replace(FLOW, c=grains.astype(np.float32)))
    x, y = found.x, found.y
    frame = np.searchsorted(FLOW.t, found.t)
    assert len(frame) > 0.7 * grains.any(axis=1).sum()
    off = (y - surface[frame, 0, np.searchsorted(FLOW.x, x)]) / (FLOW.y[1] - FLOW.y[0])
    assert np.abs(off).max() < 1
    assert np.abs(np.median(off)) < 0.1


def test_grains_end_half_a_cell_of_the_solver_higher() -> None:
    """A cell is full where its upper corner is below the surface."""
    x = np.arange(40) + 0.5
    slope, spacing = 0.5, 3
    rows = np.arange(1, 90, spacing) + 0.5  # the middle of every third cell
    corner = rows[:, None] + 0.5 * (1 + slope)
    grains = corner[None] < 30 + 0.13 * np.arange(8)[:, None, None] + slope * x
    n = grains.shape
    flow = replace(
        FLOW,
        t=np.arange(8) + 1.0,
        x=x,
        y=rows,
        u=np.zeros(n, np.float32),
        v=np.zeros(n, np.float32),
        c=grains.astype(np.float32),
    )
    none, cell, most = (
        outline(replace(flow, attributes={"grid_spacing_of_solver": c} if c else {}))
        for c in (0, 1, 9 * spacing)
    )
    off = cell.y - (30 + 0.13 * (cell.t - 1) + slope * cell.x)
    assert abs(off.mean()) < 0.05 * spacing
    assert np.mean(cell.y - none.y) == pytest.approx(0.5 * (1 + slope), rel=0.05)
    np.testing.assert_allclose(most.y - none.y, spacing * (cell.y - none.y))


def test_pressure_at_v2_only_and_dimensionless() -> None:
    p = np.arange(SURFACE.y.size, dtype=np.float32)
    flow = replace(FLOW, surface=replace(SURFACE, p=p))
    assert not training_set(flow, SCALES, "V1").surface_pressure.any()
    pressure = training_set(flow, SCALES, "V2", torch.float64).surface_pressure
    np.testing.assert_allclose(pressure * SCALES.pressure, p, rtol=1e-12)


@pytest.mark.parametrize(
    ("flow", "level", "message"),
    [
        (replace(FLOW, surface=None), "V1", "level V1 needs the free surface"),
        (replace(FLOW, surface=None), "V2", "level V2 needs the free surface"),
        (replace(FLOW, surface=replace(SURFACE, p=None)), "V2", "level V2 needs the pressure"),
        (replace(FLOW, grain_diameter=9.0), "V1", "level V1 needs points of the free surface"),
    ],
)
def test_a_level_needs_its_data(flow: Flow, level: str, message: str) -> None:
    with pytest.raises(FlowFileError, match=message):
        training_set(flow, SCALES, level)


def test_weights() -> None:
    assert torch.equal(
        training_set(FLOW, SCALES).point_weights, torch.ones(int(FLOW.valid.sum()), 2)
    )
    uniform = training_set(replace(FLOW, sigma_u=0.1, sigma_v=0.3), SCALES)
    assert torch.equal(uniform.point_weights, torch.ones(int(FLOW.valid.sum()), 2))
    sigma = np.full(FLOW.u.shape, np.nan, dtype=np.float32)
    sigma[FLOW.valid] = np.where(np.arange(FLOW.valid.sum()) % 2, 0.1, 0.2)
    weights = training_set(
        replace(FLOW, sigma_u=sigma, sigma_v=sigma), SCALES, dtype=torch.float64
    ).point_weights
    assert weights[:, 0].mean() == pytest.approx(1)
    variances = 2 * sigma[FLOW.valid].astype(float) ** 2
    expected = 1 / (variances + np.median(variances))
    np.testing.assert_allclose(weights[:, 0], expected / expected.mean(), rtol=1e-6)
    assert weights[1, 0] > 1.5 * weights[0, 0]
    assert torch.equal(weights[:, 1], torch.ones(len(weights), dtype=torch.float64))
