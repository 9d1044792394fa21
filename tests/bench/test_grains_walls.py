"""The walls of the scenes of grains."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bench.studies.grains.materials import Material
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.walls import plate_of, walls_of
from granpinn.data.walls import segments_of


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_has_walls_beside_its_grains(name: str) -> None:
    """Grains can be on one side of every wall, and of a plane of symmetry on both."""
    scene = SCENES[name](Material(0.4))
    grid, half = scene.grid, scene.grid.cell / 2
    x = np.arange(grid.left + half, grid.right, grid.cell)
    y = np.arange(grid.bottom + half, grid.top, grid.cell)
    walls = walls_of(scene.attributes, x, y)
    assert walls is not None
    found = segments_of(walls)
    middle, normal = found.ends.mean(axis=1), found.normal.mean(axis=1)
    one, two = (scene.inside(*(middle + way * 0.6 * normal).T) for way in (-1, 1))
    assert (one | two).all()
    assert (one != two).all() or scene.mirror


def test_a_drum_turns_as_a_solid() -> None:
    stated: dict[str, Any] = {"wall_radius": 10.0, "wall_rotation": 0.3}
    walls = walls_of(stated, np.arange(3.0), np.arange(3.0))
    assert walls is not None
    assert walls.u is not None
    assert walls.v is not None
    np.testing.assert_allclose(np.hypot(walls.u, walls.v), 3.0)
    np.testing.assert_allclose(walls.x * walls.v - walls.y * walls.u, 30.0)
    assert (walls.x[0], walls.y[0]) == (walls.x[-1], walls.y[-1])


def test_the_plate_is_where_the_stress_reaches_its_load() -> None:
    stated: dict[str, Any] = {"plate_load": 20.0, "plate_speed": 8.0, "period_x": 50.0}
    y = np.arange(1.0, 36, 2)
    normal = np.broadcast_to((20 + 1.1 * (41 - y))[None, :, None], (2, y.size, 4))
    plate = plate_of(stated, normal, np.full(normal.shape, -10.0), y)
    assert plate == pytest.approx((41, 10))
    walls = walls_of(stated, np.arange(4.0), y, plate)
    assert walls is not None
    assert walls.p is not None
    assert walls.tau is not None
    np.testing.assert_array_equal(walls.p[3:], 20)
    np.testing.assert_allclose(walls.tau[3:], 10)
    assert plate_of({}, normal, normal, y) is None
    assert walls_of({}, y, y) is None
