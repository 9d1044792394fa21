"""The grains study: coarse-graining, surface and dumps on particles whose fields are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.studies.grains import coarse, surface
from bench.studies.grains.materials import BULK_FRACTION, TIME_STEP, Material
from bench.studies.grains.scenes import SCENES
from bench.studies.grains.scenes.scene import COLUMNS, Grid, Scene
from bench.studies.grains.simulation import Snapshot, snapshots
from granpinn.estimates.local_fits import local_fits

SPACING = 0.5  # of the particles below, fine against the kernel
AREA = BULK_FRACTION * SPACING**2  # of a particle, so that the fraction is that of the bulk


def particles(
    left: float, right: float, bottom: float, top: float, shear: float = 0.3, height: float = 1e9
) -> Snapshot:
    """A lattice with u = shear y, v = 0.1 x and a contact stress of (2, 3, 0.5)."""
    x = np.arange(left + SPACING / 2, right, SPACING)
    y = np.arange(bottom + SPACING / 2, min(top, height), SPACING)
    x, y = (a.ravel() for a in np.meshgrid(x, y))
    one = np.ones_like(x)
    virial = np.array([2.0, 3.0, 0.5]) * SPACING**2 * one[:, None]
    return Snapshot(0.0, x, y, shear * y, 0.1 * x, AREA * one, 1.3 * AREA * one, virial)


def box(**changes: object) -> Scene:
    """A container y > 0 with 10 x 8 cells around it."""
    scene = replace(
        SCENES["collapse_2"](Material(0.4)),
        grid=Grid(0, 20, 0, 16),
        box=(0.0, 20.0, -2.0, 30.0),
        boundary="f f p",
        snapshots=1,
        frames=1,
        dropped=0.0,
        mirror=False,
    )
    return replace(scene, **changes)  # type: ignore[arg-type]


def test_linear_fields_come_back_and_leave_no_kinetic_stress() -> None:
    fields = coarse.coarse_grain(box(), [particles(-6, 26, -6, 22)])
    inner = (0, slice(2, -2), slice(2, -2))
    y, x = np.meshgrid(fields.y, fields.x, indexing="ij")
    cover = fields.coverage[inner[1:]]
    assert fields.coverage[2:].min() == pytest.approx(1)
    np.testing.assert_allclose(fields.phi[inner], BULK_FRACTION / cover, rtol=2e-3)
    np.testing.assert_allclose(fields.u[inner], 0.3 * y[inner[1:]], atol=1e-3)
    np.testing.assert_allclose(fields.v[inner], 0.1 * x[inner[1:]], atol=1e-3)
    # The cut takes 4 % of the variance of the kernel: the correction by sd^2 is not exact.
    stress = fields.stress[inner]
    np.testing.assert_allclose(stress[..., coarse.XX], 2, atol=0.012)
    np.testing.assert_allclose(stress[..., coarse.YY], 3, atol=0.012)
    np.testing.assert_allclose(stress[..., coarse.XY], 0.5, atol=0.012)


def test_surface_is_where_the_particles_end() -> None:
    fields = coarse.coarse_grain(box(), [particles(-6, 26, 0, 22, height=10.0)])
    height = surface.surface_height(fields)
    np.testing.assert_allclose(height, 10.0, atol=0.1)
    c = surface.fraction(fields, height)[0]
    rows = fields.y
    assert (c[rows < 10 - surface.AWAY] == 1).all()
    near = (rows > 10 - surface.AWAY) & (rows < 10)
    assert near.any()
    assert ((c[near] < 1) & (c[near] > 0.3)).all()
    assert c[rows > 14].max() == 0


def dump(path: Path, rows: list[str], columns: tuple[str, ...] = COLUMNS) -> Path:
    path.write_text(
        f"ITEM: TIMESTEP\n200\nITEM: NUMBER OF ATOMS\n{len(rows)}\n"
        "ITEM: BOX BOUNDS ff ff pp\n0 1\n0 1\n-0.5 0.5\n"
        f"ITEM: ATOMS {' '.join(columns)}\n" + "\n".join(rows) + "\n"
    )
    return path


def test_a_dump_is_read(tmp_path: Path) -> None:
    path = dump(tmp_path / "a", ["1 2 3 4 0.5 0.9 -7 -8 9", "5 6 7 8 0.6 1.1 1 2 3"])
    path.write_text(2 * path.read_text())
    first, second = snapshots(path)
    assert first.t == pytest.approx(200 * TIME_STEP)
    np.testing.assert_array_equal(first.x, [1, 5])
    np.testing.assert_array_equal(first.vy, [4, 8])
    np.testing.assert_array_equal(first.virial, [[7, 8, -9], [-1, -2, -3]])  # pressure positive
    np.testing.assert_allclose(first.solid, np.pi * np.array([0.25, 0.36]))
    np.testing.assert_array_equal(second.mass, [0.9, 1.1])


def test_local_fits_leave_lonely_cells_out_and_wrap_around() -> None:
    field = np.ones((1, 6, 6))
    weight = np.zeros_like(field)
    weight[0, 0, 0] = 1
    found = local_fits([field * weight], weight, (1, 1, 1), (0, 2, 2), 2)
    assert found.value.size == 0
    wave = np.sin(2 * np.pi * np.arange(24) / 24) * np.ones((1, 6, 1))
    found = local_fits([wave], np.ones_like(wave), (1, 1, 1), (0, 2, 2), 2, periodic=True)
    fitted = found.value.reshape(wave.shape)
    np.testing.assert_allclose(fitted[0, 3], wave[0, 3], atol=2e-3)
