"""The grains study: spheres between side walls, and the command that makes all scenes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.studies.grains import coarse, slabs
from bench.studies.grains.materials import SPHERES, Material
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.scenes.channel import COLUMNS, GAP, LENGTH
from granpinn.arrays import Float64
from tests.bench.test_grains_fields import dump

SPACING = 0.5
RADIUS = SPACING / 2
FRACTION = np.pi / 6  # of a cubic lattice of touching spheres


def spheres() -> Float64:
    """A lattice that fills the channel to 10 d: u = y + z, contact stress of (2, 3, 0.5) and 4.

    The walls push each grain that touches them with 0.2 along -x and 2 across.
    """
    axes = [np.arange(RADIUS, extent, SPACING) for extent in (LENGTH, 10.0, GAP)]
    x, y, z = (a.ravel() for a in np.meshgrid(*axes))
    one = np.ones_like(x)
    beside = (z < SPACING).astype(float) - (z > GAP - SPACING)
    mass = SPHERES.density * np.pi / 6 * SPACING**3 * one
    stress = [-s * SPACING**3 * one for s in (2.0, 3.0, 0.5, 4.0)]
    side = [-0.2 * np.abs(beside), 0 * one, 2 * beside]
    return np.stack([x, y, z, y + z, 0 * one, RADIUS * one, mass, *stress, *side], axis=1)


def test_a_slab_has_the_fields_of_its_part_of_the_width(tmp_path: Path) -> None:
    rows = [" ".join(f"{v:.7g}" for v in row) for row in spheres()]
    path = dump(tmp_path / "grains.dump", rows, COLUMNS)
    path.write_text(2 * path.read_text())
    scene = replace(SCENES["channel_wall"](Material(0.4)), snapshots=2, frames=2)
    whole, seen = (
        coarse.coarse_grain(scene, slabs.slabs(path, low, high)) for low, high in ((0, GAP), (0, 2))
    )
    rows = slice(3, 7)
    for fields, z in ((whole, GAP / 2), (seen, 1.0)):
        np.testing.assert_allclose(fields.phi[:, rows], FRACTION, rtol=5e-3)
        np.testing.assert_allclose(fields.rho[:, rows], FRACTION * SPHERES.density, rtol=5e-3)
        means = fields.u[:, rows].mean(axis=(0, 2)) - fields.y[rows]
        np.testing.assert_allclose(means, z, atol=0.02)
        assert fields.stress[:, rows, :, coarse.YY].mean() == pytest.approx(3, rel=5e-3)
    assert slabs.measured_bulk(seen).bulk == pytest.approx(FRACTION, rel=0.02)
    made = slabs.side_walls(scene, path, slabs.measured_bulk(whole))
    assert made["friction"] == pytest.approx(0.1)
    # 0.2 per SPACING^2 of a wall; the velocity varies across, which adds a kinetic stress to p.
    p = whole.stress[..., [coarse.XX, coarse.YY]].mean(axis=(0, 2, 3))
    full = whole.phi.mean(axis=(0, 2)) > 0.9 * FRACTION
    assert made["friction_by_p"] == pytest.approx(0.2 / SPACING**2 / p[full].mean(), rel=1e-3)
