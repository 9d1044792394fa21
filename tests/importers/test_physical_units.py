"""The same flow in other units, axes and formats leads to the same dimensionless training set.

The collapse that comes with the package is measured here by an imaginary camera: in
millimeters and milliseconds, in pixels and frames with y down, and with the camera tilted.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from granpinn.data import Flow, Surface, TrainingSet, read_flow, training_set, write_flow
from granpinn.data.scaling import equation_constants, scales_of
from granpinn.importers import read
from granpinn.simulation import demo_path

DIAMETER = 0.32e-3  # m, of the grains of the demonstration
MILLIMETERS = 1e3  # of a metre
G = 9.81
MILLISECONDS = 1e3  # of a second
SPEED = MILLIMETERS / MILLISECONDS  # mm/ms of one m/s
FRACTION = 0.6


@pytest.fixture(scope="module")
def demo() -> Flow:
    """Every fifth frame of the demonstration."""
    flow = read_flow(demo_path())
    kept = slice(None, None, 5)
    u, v, c = (a[kept] for a in (flow.u, flow.v, flow.c))
    assert flow.surface is not None
    return replace(flow, t=flow.t[kept], u=u, v=v, c=c, p=None, eta_max=None, eta_min=None)


def dimensionless(flow: Flow, level: str = "V1") -> tuple[TrainingSet, float]:
    scales = scales_of(flow)
    data = training_set(flow, scales, level, torch.float64)
    return data, equation_constants(flow, scales).grain_diameter


def measured(flow: Flow, **changes: Any) -> dict[str, Any]:
    """The flow in mm and ms, in float64."""
    return {
        "t": flow.t * MILLISECONDS,
        "y": flow.y * MILLIMETERS,
        "x": flow.x * MILLIMETERS,
        "u": flow.u.astype(np.float64) * SPEED,
        "v": flow.v.astype(np.float64) * SPEED,
        "c": flow.c.astype(np.float64),
        "length_unit": "mm",
        "time_unit": "ms",
        "velocity_unit": "mm/ms",
        **changes,
    }


def material() -> dict[str, Any]:
    """Grains whose effective diameter is that of the demonstration, d sqrt(rho_g / rho)."""
    d = DIAMETER * MILLIMETERS * math.sqrt(FRACTION)
    return {
        "grain_diameter": f"{d!r} mm",
        "grain_density": "2.5 g/cm^3",
        "solid_fraction": FRACTION,
    }


def surface_file(path: Path, flow: Flow, factor: float, unit: str) -> str:
    assert flow.surface is not None
    s = flow.surface
    rows = [
        f"{t * MILLISECONDS!r},{x * factor!r},{y * factor!r}"
        for t, x, y in zip(s.t.tolist(), s.x.tolist(), s.y.tolist(), strict=True)
    ]
    path.write_text("\n".join([f"t [ms],x [{unit}],y [{unit}]", *rows]) + "\n")
    return str(path)


def assert_same(ours: tuple[TrainingSet, float], theirs: tuple[TrainingSet, float]) -> None:
    """To 1e-6, relative to the largest of each array: flow files hold float32 velocities."""
    assert ours[1] == pytest.approx(theirs[1], rel=1e-6)
    for name, value in theirs[0].arrays().items():
        found, expected = (torch.as_tensor(a) for a in (getattr(ours[0], name), value))
        assert found.shape == expected.shape, name
        if expected.numel():
            error = float((found - expected).abs().max())
            assert error <= 1e-6 * float(expected.abs().max()), name


def test_millimeters_and_milliseconds(tmp_path: Path, demo: Flow) -> None:
    line = surface_file(tmp_path / "surface.csv", demo, MILLIMETERS, "mm")
    flow = read(measured(demo), surface=line, **material())
    assert (flow.length_unit, flow.time_unit, flow.density_unit) == ("m", "s", "kg/m^3")
    assert (flow.density, flow.grain_density) == pytest.approx((1500, 2500))
    assert flow.gravity == pytest.approx((0, -G))
    write_flow(flow, tmp_path / "flow.h5")
    inside = (demo.surface.t >= demo.t[0]) & (demo.surface.t <= demo.t[-1] + 1e-9)  # type: ignore[union-attr]
    seen = Surface(*(getattr(demo.surface, name)[inside] for name in ("t", "x", "y")))
    # The size of the grains also says which surface points lie in the toe.
    d = DIAMETER * math.sqrt(FRACTION)
    same = replace(demo, surface=seen, grain_diameter=d, grain_density=1500 / FRACTION)
    expected = dimensionless(same)
    assert expected[1] == pytest.approx(DIAMETER / scales_of(demo).length)
    assert len(expected[0].surface_points) > 100
    assert_same(dimensionless(read_flow(tmp_path / "flow.h5")), expected)


def scattered(demo: Flow, tilt: float) -> dict[str, Any]:
    """The vectors of the demonstration as a camera sees them that is turned by `tilt`.

    In its image a plumb line leans by `tilt` to the right: all is turned counterclockwise.
    """
    frame, row, column = np.nonzero(demo.valid)
    cos, sin = math.cos(tilt), math.sin(tilt)
    m = measured(demo)
    x, y = m["x"][column], m["y"][row]
    u, v = (m[name][frame, row, column] for name in ("u", "v"))
    return {
        "t": m["t"][frame],
        "x": cos * x - sin * y,
        "y": sin * x + cos * y,
        "u": cos * u - sin * v,
        "v": sin * u + cos * v,
        "length_unit": "mm",
        "time_unit": "ms",
        "velocity_unit": "mm/ms",
    }


def test_a_tilted_camera_rotates_gravity(demo: Flow) -> None:
    """The training sets are upright and agree to the last bit, though the files do not."""
    tilt = math.radians(1.2)
    level = read(scattered(demo, 0.0), surface="none", **material())
    tilted = read(scattered(demo, tilt), surface="none", tilt="1.2 deg", **material())
    assert tilted.gravity == pytest.approx((G * math.sin(tilt), -G * math.cos(tilt)))
    expected, d = dimensionless(level, "V0")
    found, d_tilted = dimensionless(tilted, "V0")
    assert d_tilted == pytest.approx(d, rel=1e-6)
    for name in ("points", "velocity"):
        assert torch.equal(getattr(found, name), getattr(expected, name)), name
    assert tilted.particles is not None
    assert level.particles is not None
    assert np.abs(tilted.particles.x - level.particles.x).max() > 0.01 * level.particles.x.max()


def test_round_trip_without_dimensions(demo: Flow) -> None:
    """SI to dimensionless and back, points and velocities, in float64: 1e-12."""
    flow = read(measured(demo), surface="none", **material())
    scales = scales_of(flow)
    points = scales.points_to_dimensionless(flow.x[3], flow.y, flow.t[1])
    np.testing.assert_allclose(scales.points_to_physical(points)[:, 1], flow.y, rtol=1e-12)
    speed = measured(demo)["u"][flow.valid]
    there = scales.to_dimensionless(speed, "velocity")
    np.testing.assert_allclose(scales.to_physical(there, "velocity"), speed, rtol=1e-12)
