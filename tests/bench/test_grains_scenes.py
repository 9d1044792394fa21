"""The grains study: the start of every scene, and LAMMPS as an outside program."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from bench.studies.grains.materials import FRICTIONS, Material
from bench.studies.grains.packing import FREE
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.scenes.scene import script


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_scene_starts_without_contacts_inside_its_box(name: str, friction: float) -> None:
    material = Material(friction)
    scene = SCENES[name](material)
    parts = scene.packing(1)
    free = np.concatenate([part.centre for part in parts if part.kind[0] == FREE])
    assert KDTree(free).query(free, k=2)[0][:, 1].min() > 1.15
    low, high = scene.box[::2], scene.box[1::2]
    assert ((free > low) & (free < high)).all()
    text = script(scene, material)
    assert "WALL" not in text
    assert f"{friction:g} 1" in text
    assert text.rstrip().splitlines()[-1].startswith("run ")
