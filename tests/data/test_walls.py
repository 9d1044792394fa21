"""Walls: geometry, and the conditions that the vectors do not contradict."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from granpinn.data import Flow, FlowFileWarning, Walls, check_flow, with_partial_cells
from granpinn.data.outline import outline
from granpinn.data.scaling import scales_of
from granpinn.data.wall_points import walls_of
from granpinn.data.walls import crossed, samples, segments_of
from granpinn.training.points import training_set
from tests.data.walled import FLOOR, NAN, full, line, single
from tests.flows import make_chute


def test_normals_of_a_drum_point_to_its_center() -> None:
    """Corners keep the normals of their sides; the polygon of a drum has those of the circle."""
    a = np.linspace(0, 2 * np.pi, 41)
    drum = segments_of(Walls(x=np.cos(a), y=np.sin(a)))
    np.testing.assert_allclose(drum.normal, -drum.ends, atol=1e-12)
    corner = segments_of(line((0, 1), (0, 0), (1, 0)))
    np.testing.assert_allclose(corner.normal, [[[1, 0]] * 2, [[0, 1]] * 2], atol=1e-12)


def test_crossed() -> None:
    wall = segments_of(line((0, 0), (0, 1), (0, 2)))
    paths = {
        "through": ((-1, 0.5), (1, 0.5), True),
        "through a point of the wall": ((-1, 1), (1, 1), True),
        "back": ((1, 0.5), (-1, 0.7), True),
        "beside": ((-2, 0.5), (-1, 0.5), False),
        "above its end": ((-1, 2.5), (1, 2.5), False),
        "around its end": ((-1, 1.5), (1, 3.5), False),
        "ends on it": ((-1, 0.5), (0, 0.5), False),
        "begins on it": ((0, 0.3), (1, 0.5), False),
        "along it": ((0, 0.2), (0, 1.7), False),
        "long and slanted": ((-5, -5), (5, 6), True),
    }
    start, end = (np.array([p[k] for p in paths.values()], float) for k in (0, 1))
    found = dict(zip(paths, crossed(start, end, wall), strict=True))
    assert found == {name: p[2] for name, p in paths.items()}


def test_a_path_without_an_end_crosses_nothing() -> None:
    plate = segments_of(line((-1, 1), (1, 1)))
    start, end = np.zeros((2, 2)), np.array([[0.0, 2.0], [NAN, NAN]])
    np.testing.assert_array_equal(crossed(start, end, plate), [True, False])


def test_samples_are_evenly_spaced_and_off_the_corners() -> None:
    walls = segments_of(line((0, 0), (3, 0), (3, 1)))
    k, part = samples(walls, 0.5)
    place = walls.ends[k, 0] + part[:, None] * (walls.ends[k, 1] - walls.ends[k, 0])
    along = place.sum(axis=1)
    np.testing.assert_allclose(along, 0.25 + 0.5 * np.arange(8), atol=1e-12)


def sheared(velocity: Any, walls: Walls, noise: float = 0.0, seed: int = 0, **changes: Any) -> Flow:
    """A steady flow in the box 0..16 x 0..12 with cells of 1 and a velocity u, v = f(x, y)."""
    x, y = np.arange(16) + 0.5, np.arange(12) + 0.5
    u, v = np.broadcast_arrays(*velocity(*np.meshgrid(x, y)))
    rng = np.random.default_rng(seed)
    u, v = (a[None] + noise * rng.normal(size=(1, *a.shape)) for a in (u, v))
    c = np.ones((1, 12, 16), np.float32)
    flow = Flow(
        t=np.zeros(1), y=y, x=x, u=u, v=v, c=c, gravity=(0.0, -1.0), density=1.0,
        grain_diameter=1.0, walls=walls,
    )  # fmt: skip
    return replace(flow, **changes)


BOX = line((0, 12), (0, 0), (16, 0), (16, 12), (NAN, NAN), (0, 12), (16, 12))


def stagnation(x: Any, y: Any) -> Any:
    """A roll that fills the box."""
    u = np.sin(np.pi * x / 16) * np.cos(np.pi * y / 12) * 16 / 12
    return u, -np.cos(np.pi * x / 16) * np.sin(np.pi * y / 12)


def test_vectors_of_a_box_hold_its_conditions(seed: int) -> None:
    """Slip along the box: v . n = 0, and the velocity along the wall is that of the vectors."""
    flow = sheared(stagnation, BOX, noise=0.01, seed=seed % 1000)
    check_flow(flow)
    touch, facts = walls_of(flow, BOX)
    assert len(touch.point) == 2 * 16 + 2 * 12
    assert np.mean(touch.closed) > 0.95
    k = touch.closed
    side = np.isin(touch.point[:, 0], (0.0, 16.0))
    through = np.where(side, touch.target[:, 0], touch.target[:, 1])
    np.testing.assert_allclose(through[k], 0, atol=1e-12)
    exact = np.stack(stagnation(*touch.point.T[:2]), 1)
    # A plane over 3 cells misses the curvature (4/3) (pi/12)^2 by 3^2/8 times it at most.
    assert np.abs(touch.target - exact)[k].max() < 0.05 + 4 / 3 * (np.pi / 12) ** 2 * 9 / 8
    assert [wall.stated for wall in facts] == [False, False]


def test_no_slip_where_vectors_agree_and_slip_where_they_do_not(seed: int) -> None:
    """u = 1 + y: the floor slips though the file denies it; the side that moves along sticks."""
    walls = replace(FLOOR, x=np.array([0.0, 16.0]), slip=single(0, 0))
    slips = sheared(lambda x, y: (1 + y, 0 * y), walls, 0.01, seed % 1000)
    sticks = sheared(lambda x, y: (y, 0 * y), walls, 0.01, seed % 1000)
    moving = replace(walls, u=full(1.0), v=full(0.0))
    with pytest.warns(FlowFileWarning, match="grains slip along the wall from .0, 0. to .16, 0."):
        data = on_walls(slips)
    np.testing.assert_allclose(data.wall_velocity[:, 0], 1 / np.sqrt(12), atol=0.05)
    for flow in (sticks, replace(slips, walls=moving)):
        data = on_walls(flow)
        wall = 0.0 if flow is sticks else 1.0
        exact = scales_of(flow).to_dimensionless(np.full(16, wall), "velocity")
        # A chance of some per mille in every point.
        assert np.mean(np.abs(data.wall_velocity[:, 0].numpy() - exact) < 1e-6) > 0.8


def on_walls(flow: Flow) -> Any:
    scales = scales_of(flow)
    return training_set(flow, scales, "V0")


def test_a_wall_that_grains_flow_through_is_none(seed: int) -> None:
    across = sheared(lambda x, y: (0 * x, -1 - 0 * y), FLOOR, 0.01, seed % 1000)
    with pytest.warns(FlowFileWarning, match="grains flow through the wall"):
        data = on_walls(across)
    assert len(data.wall_points) == 0
    found = walls_of(across, replace(FLOOR, slip=single(0, 0)))
    assert not found[0].sticks.any()


def test_a_turning_drum() -> None:
    """A rigid rotation: no slip holds on the moving wall and not on one at rest."""
    a = np.linspace(0, 2 * np.pi, 61)
    axis = np.linspace(-9.5, 9.5, 20)
    x, y = np.meshgrid(axis, axis)
    inside = np.hypot(x, y) < 9.5
    flow = Flow(
        t=np.zeros(1), y=axis, x=axis, u=np.where(inside, -0.3 * y, np.nan)[None],
        v=np.where(inside, 0.3 * x, np.nan)[None], c=inside[None].astype(np.float32),
        gravity=(0.0, -1.0), density=1.0, grain_diameter=1.0,
    )  # fmt: skip
    circle = Walls(x=10 * np.cos(a), y=10 * np.sin(a), slip=np.zeros(61, np.float32))
    turning = replace(circle, u=-0.3 * circle.y, v=0.3 * circle.x)
    for walls, share in ((turning, 1.0), (circle, 0.0)):
        found = walls_of(flow, walls)
        assert len(found[0].point) >= 50  # of 62; cells are up to 2 away elsewhere
        assert found[1][0].sticks == share
        assert found[1][0].closed == 1.0


def test_known_pressure_counts_at_every_level() -> None:
    plate = replace(line((0, 12), (16, 12)), p=single(3, 5))
    data = on_walls(sheared(lambda x, y: (y, 0 * y), plate))
    scales = scales_of(sheared(lambda x, y: (y, 0 * y), plate))
    x = scales.points_to_physical(data.surface_points.double())[:, 0]
    p = scales.to_physical(data.surface_pressure.numpy(), "pressure")
    assert len(x) == 16
    np.testing.assert_allclose(p, 3 + 2 * x / 16, rtol=1e-5)


def test_pool_weighs_walls_like_vectors() -> None:
    """The mean over the pool is (sum over vectors + sum over walls)/N, and that of the equations
    over the vectors and the points between is what it was."""
    flow = sheared(lambda x, y: (y, 0 * y), replace(FLOOR, x=np.array([0.0, 16.0])))
    scales = scales_of(flow)
    data = training_set(flow, scales, "V0", collocation=0.5)
    pool = data.pooled()
    N, B, W = 16 * 12, len(data.between), 16
    assert len(pool.points) == N + B + W
    means = pool.point_weights.double().mean(0)
    torch.testing.assert_close(means, torch.tensor([(N + W) / N, 1.0]).double())
    assert (pool.point_weights[-W:, 1] == 0).all()
    assert (pool.point_weights[-W:, 0] == pool.point_weights[0, 0]).all()


def test_no_equation_behind_a_wall() -> None:
    """A thin wall between two halves full of grains: no point in the cells that it cuts."""
    wall = line((8.2, 0), (8.2, 12))
    flow = sheared(lambda x, y: (0 * y, x), wall)
    scales = scales_of(flow)
    for own, least in ((flow, 1000), (replace(flow, walls=None), 1000)):
        points = training_set(own, scales, "V0", collocation=10).between
        x = scales.points_to_physical(points.double())[:, 0]
        assert len(x) > least
        cut = (x > 7.5) & (x < 8.5)
        assert cut.any() == (own.walls is None)


def test_a_plate_is_no_free_surface() -> None:
    c = np.ones((1, 12, 16), np.float32)
    c[:, 10:] = 0
    free = sheared(lambda x, y: (y, 0 * y), line((0, 0), (16, 0)), c=c)
    half = replace(free, walls=line((0, 10.2), (8, 10.2)))
    assert outline(free).x.size == 16
    np.testing.assert_array_equal(outline(half).x, np.arange(8) + 8.5)


def test_partly_filled_cells_behind_a_wall_are_no_grains() -> None:
    c = np.ones((1, 12, 16), np.float32)
    c[:, :, 8:] = 0.6
    flow = sheared(lambda x, y: (y, 0 * y), line((0, 0), (16, 0)), c=c)
    assert with_partial_cells(flow).material.all()
    split = with_partial_cells(replace(flow, walls=line((8, 0), (8, 12)))).material[0]
    np.testing.assert_array_equal(split, np.broadcast_to(np.arange(16) < 8, (12, 16)))


def test_walls_of_a_chute_hold() -> None:
    """Bagnold's flow stands on its bed: no slip at y = 0, to the error of the extrapolation."""
    bed = replace(line((0, 0), (32, 0)), slip=single(0, 0))
    found = walls_of(make_chute(), bed)
    assert found[1][0].points == 16
    assert found[1][0].closed == 1.0
