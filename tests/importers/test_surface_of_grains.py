"""Tracked grains: the free surface from their density, and the direction of y from gravity."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.importers import Settings, convert
from granpinn.importers.surface import surface_of_grains

D = 0.01

TIMES = np.linspace(0, 1, 6)

DOWN = (0.0, -9.81)


def height(x: Any, t: float) -> Any:
    """The free surface: a slope that sinks and becomes flatter."""
    return 0.5 - 0.1 * t - (0.4 - 0.3 * t) * x


def grains(tracked: float = 1.0, seed: int = 0) -> Any:
    """t, x, y of disks in rows below the surface, shifted at random; a part of them is tracked."""
    rng = np.random.default_rng(seed)
    parts = []
    for t in TIMES:
        rows, columns = np.arange(D / 2, 0.6, 0.87 * D), np.arange(D / 2, 1, D)
        y, x = np.meshgrid(rows, columns, indexing="ij")
        x = x + D / 2 * (np.arange(rows.size) % 2)[:, None] + 0.1 * D * rng.normal(size=x.shape)
        y = y + 0.1 * D * rng.normal(size=x.shape)
        below = (y < height(x, t)) & (x < 1) & (rng.random(x.shape) < tracked)
        parts.append(np.stack([np.full(int(below.sum()), t), x[below], y[below]]))
    return np.concatenate(parts, axis=1)


@pytest.mark.parametrize(("tracked", "sd"), [(1.0, 0.55), (0.5, 1.5)])
def test_the_surface_of_tracked_grains(tracked: float, sd: float) -> None:
    """Every point lies near the line, their mean within the standard deviation that is stated."""
    found = surface_of_grains(*grains(tracked), D, DOWN)
    assert found is not None
    line, stated = found
    assert 0.3 * D < stated < sd * D
    error = np.array([y - height(x, t) for t, x, y in zip(line.t, line.x, line.y, strict=True)])
    inner = (line.x > 0.05) & (line.x < 0.95)
    assert abs(np.mean(error[inner])) < stated
    assert np.quantile(np.abs(error[inner]), 0.95) < 2.5 * stated
    assert set(line.t) == set(TIMES)


def test_the_edge_of_a_picture_is_no_surface() -> None:
    t, x, y = grains()
    inside = y < 0.1
    assert surface_of_grains(t[inside], x[inside], y[inside], D, DOWN) is None


def test_one_grain_far_away_takes_no_memory() -> None:
    t, x, y = grains()
    x[3] = 1e30
    assert surface_of_grains(t, x, y, D, DOWN) is None


MATERIAL = {"grain_diameter": "10 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_tracks_in_a_unit_of_length(tmp_path: Path, sign: float) -> None:
    """They need no other unit, and their surface comes with its standard deviation."""
    t, x, y = grains()
    rows = ["t_s,x_mm,y_mm,vx,vy"]
    for a, b, c in zip(t, x, y, strict=True):
        u, v = 100 * c, sign * (50 * (b - 0.5) - 100)
        rows.append(f"{a},{1e3 * b},{sign * 1e3 * c},{u},{v}")
    (tmp_path / "a.csv").write_text("\n".join(rows))
    settings = Settings(**MATERIAL, velocity_unit="mm/s", flip_y="no" if sign > 0 else "yes")
    flow = convert(tmp_path / "a.csv", settings)
    assert flow.particles is not None
    assert flow.particles.v.mean() == pytest.approx(-0.1, rel=0.1)
    assert flow.surface is not None
    high = flow.surface.y[np.argsort(flow.surface.x)]
    assert high[:50].mean() > high[-50:].mean()
    assert flow.attributes["surface_sd"] == pytest.approx(D / 2, rel=0.2)
