"""The walls of the scenes of grains."""

from __future__ import annotations

import numpy as np
import pytest

from bench.studies.grains.materials import Material
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.walls import walls_of
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
