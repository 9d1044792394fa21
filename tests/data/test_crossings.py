"""Crossings of paths with many walls: the same as one by one, and in time that grows with both."""

from __future__ import annotations

import time
import warnings
from dataclasses import replace

import numpy as np
import pytest

from granpinn.arrays import Bool, Float64
from granpinn.config import Config
from granpinn.data import FlowFileError, Walls, check_flow
from granpinn.data.wall_points import MOST_WARNINGS
from granpinn.data.walls import ON_WALL, Segments, crossed, segments_of
from granpinn.fit.case import pose
from tests.flows import make_flow

MANY = 99_999  # points: walls may have 100,000


NAN = np.nan


def one_by_one(start: Float64, end: Float64, segments: Segments) -> Bool:
    """Whether both ends of each of two lines are on different sides of the other line."""
    extent = max(
        float(np.ptp(a, axis=(0, 1)).max()) for a in (np.stack([start, end]), segments.ends)
    )
    found = np.zeros(len(start), bool)
    for a, b in segments.ends:
        u = (b - a) / np.hypot(*(b - a))
        one, two = (u[0] * (p - a)[:, 1] - u[1] * (p - a)[:, 0] for p in (start, end))
        apart = (np.minimum(one, two) < -ON_WALL * extent) & (
            np.maximum(one, two) > ON_WALL * extent
        )
        d = end - start
        first, last = (d[:, 0] * (p - start)[:, 1] - d[:, 1] * (p - start)[:, 0] for p in (a, b))
        found |= apart & (first * last <= 0)
    return found


@pytest.mark.parametrize("trial", range(40))
def test_paths_cross_as_one_by_one(trial: int) -> None:
    """At random, and on a lattice, where paths end on walls and run along them."""
    rng = np.random.default_rng(trial)
    n, m = rng.integers(1, 200), rng.integers(2, 60)
    if trial % 2:
        x, y = np.cumsum(rng.normal(size=(2, m)), axis=1) * 10 ** rng.uniform(-3, 1)
        start = 4 * rng.random((n, 2))
        end = start + rng.normal(size=(n, 2)) * 10 ** rng.uniform(-2, 1)
    else:
        x, y = rng.integers(0, 5, (2, m)).astype(float)
        x[0], x[1] = 0.0, 4.0
        start, end = rng.integers(0, 5, (2, n, 2)).astype(float)
    segments = segments_of(Walls(x=x, y=y))
    expected = one_by_one(start, end, segments)
    np.testing.assert_array_equal(crossed(start, end, segments), expected)


def polyline() -> Walls:
    s = np.linspace(0, 1, MANY)
    return Walls(x=2.2 * s - 0.1, y=0.001 * np.sin(40 * s))


def obstacles() -> Walls:
    """33,333 separate short walls."""
    place = np.random.default_rng(1).random((MANY // 3, 2)) * [2, 1.1]
    x, y = (np.stack([a, a + 0.002, np.full(len(a), NAN)], 1).ravel() for a in place.T)
    return Walls(x=x, y=y)


@pytest.mark.parametrize("walls", [polyline(), obstacles()], ids=["one line", "obstacles"])
def test_a_training_with_100000_points_of_walls_is_prepared_in_3_s(walls: Walls) -> None:
    flow = replace(make_flow(frames=8, rows=27, columns=23), walls=walls)
    begin = time.process_time()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        pose(flow, Config())
    assert time.process_time() - begin < 3
    assert len(warned) <= MOST_WARNINGS + 1  # of the obstacles, the vectors contradict hundreds


def test_walls_that_go_to_and_fro_are_refused() -> None:
    """Each spacing of a wall is a point of the training, in every frame."""
    walls = Walls(x=np.tile([0.0, 2.0], MANY // 2), y=np.linspace(0, 1, 2 * (MANY // 2)))
    with pytest.raises(FlowFileError, match="at most 100000 points, and as many spacings of"):
        check_flow(replace(make_flow(), walls=walls))
