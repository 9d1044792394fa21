"""Grains and free surface: from a fraction field, a mask, an image, a line, or vectors alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.data import FlowFileWarning, check_flow
from granpinn.importers import DataFileError, Validity, read
from granpinn.importers.surface import from_fraction

DOWN = (0.0, -1.0)
Y = 0.5 + np.arange(8.0)
X = 0.5 + np.arange(10.0)
T = np.array([1.0, 2.0, 3.0])
MATERIAL: dict[str, Any] = {"dimensionless": True, "grain_diameter": "0.1"}


def heap(width: float) -> Any:
    """Volume fraction [Y, X] below the line h = 5 - 5 x / width, the bed at y = 0, exact cells."""
    return np.clip(5 - 5 * X / width - (Y[:, None] - 0.5), 0, 1)


C = np.stack([heap(w) for w in (5.0, 8.0, 10.0)])


def arrays(**changes: Any) -> dict[str, Any]:
    u = np.where(C > 0, 1.0 + X, np.nan)
    return {"t": T, "y": Y, "x": X, "u": u, "v": -0.5 * u, **changes}


def height(width: float, x: Any) -> Any:
    return 5 - 5 * x / width


def test_fraction_gives_the_line() -> None:
    """Half a cell is what a slope of one cell per cell leaves open."""
    surface = from_fraction(C, T, Y, X, DOWN)
    assert surface is not None
    for t, width in zip(T, (5.0, 8.0, 10.0), strict=True):
        at = surface.t == t
        assert at.sum() >= 5
        assert np.abs(surface.y[at] - height(width, surface.x[at])).max() < 0.5
    assert surface.y.min() >= 0.5


def test_of_a_plane_it_is_exact() -> None:
    """A horizontal surface inside a cell: the crossing of c = 1/2 to the last digit."""
    c = np.zeros((2, 8, 10))
    c[:, :3] = 1
    c[:, 3] = 0.25
    surface = from_fraction(c, T[:2], Y, X, DOWN)
    assert surface is not None
    np.testing.assert_allclose(surface.y, 2.5 + 0.5 / 0.75)
    assert surface.t.size == 2 * X.size


def test_bed_and_walls_are_no_surface() -> None:
    """Grains in a box of masked cells: only the top counts."""
    c = np.zeros((2, 8, 10))
    c[:, 2:5, 3:7] = 1
    surface = from_fraction(c, T[:2], Y, X, DOWN)
    assert surface is not None
    np.testing.assert_array_equal(np.unique(surface.y), [5.0])
    np.testing.assert_array_equal(np.unique(surface.x), X[3:7])


def test_a_steep_flank_is_surface_where_grains_come_later() -> None:
    c = np.zeros((2, 8, 10))
    c[0, :5, :3] = 1
    c[1, :2, :7] = 1
    surface = from_fraction(c, T[:2], Y, X, DOWN)
    assert surface is not None
    first = surface.t == T[0]
    flank = first & (surface.x == 3.0)
    np.testing.assert_array_equal(np.sort(surface.y[flank]), Y[:2])
    assert not (surface.x[first] > 3.0).any()


@pytest.mark.parametrize(("gravity", "axis"), [((1.0, 0.0), "x"), ((-1.0, 0.0), "x")])
def test_up_is_against_gravity(gravity: tuple[float, float], axis: str) -> None:
    c = np.zeros((2, 8, 10))
    c[:, :, 4:6] = 1
    surface = from_fraction(c, T[:2], Y, X, gravity)
    assert surface is not None
    expected = 4.0 if gravity[0] > 0 else 6.0
    np.testing.assert_array_equal(np.unique(getattr(surface, axis)), [expected])


def masked() -> dict[str, Any]:
    codes = np.where(C > 0.5, Validity.VALID, Validity.MASKED)
    codes[1, 0, 2] = Validity.INVALID
    u = 1.0 + X + 0 * C
    return arrays(u=u, v=-0.5 * u, validity=codes)


def test_mask_makes_grains_and_surface() -> None:
    flow = read(masked(), **MATERIAL)
    check_flow(flow)
    np.testing.assert_array_equal(flow.c, C > 0.5)
    assert np.isnan(flow.u[1, 0, 2])
    assert flow.c[1, 0, 2] == 1  # a gap among the grains
    assert np.isnan(flow.u[flow.c == 0]).all()
    assert flow.surface is not None
    for t, width in zip(T, (5.0, 8.0, 10.0), strict=True):
        at = flow.surface.t == t
        assert np.abs(flow.surface.y[at] - height(width, flow.surface.x[at])).max() <= 1.0


def write_image(path: Path, bright: Any) -> str:
    from PIL import Image

    Image.fromarray(np.where(bright, 200, 3).astype(np.uint8)).save(path)
    return str(path)


def in_pixels(**changes: Any) -> dict[str, Any]:
    """The heap in an image of 100 x 80 px, 10 px to a cell, y down; vectors everywhere."""
    u = (1.0 + X + 0 * C)[:, ::-1]
    pixels = arrays(u=u, v=0.5 * u, x=10 * X, y=10 * Y, y_down=True, t=T - 1)
    units = {"length_unit": "px", "time_unit": "frame", "velocity_unit": "px/frame"}
    return {**pixels, **units, **changes}


PHYSICAL: dict[str, Any] = {
    "scale": "1 mm/px",
    "frame_rate": "100 Hz",
    "grain_diameter": "1 mm",
    "grain_density": "2500 kg/m^3",
    "solid_fraction": 0.6,
}


def test_wrong_mask_images_are_refused(tmp_path: Path) -> None:
    small = write_image(tmp_path / "small.png", np.ones((40, 100)))
    with pytest.raises(DataFileError, match="must cover the vectors, got 40 pixels along y"):
        read(in_pixels(), mask=small, **PHYSICAL)
    for k in range(2):
        write_image(tmp_path / f"m{k}.png", np.ones((80, 100)))
    with pytest.raises(DataFileError, match="one for each of the 3 frames, got 2"):
        read(in_pixels(), mask=str(tmp_path / "m?.png"), **PHYSICAL)
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(DataFileError, match="cannot be read as an image"):
        read(in_pixels(), mask=str(tmp_path / "text.png"), **PHYSICAL)
    with pytest.raises(DataFileError, match="mask needs vectors in pixels"):
        read(in_pixels(length_unit="mm"), mask=small, **PHYSICAL)


def line_file(path: Path, head: str, factor: float = 1.0, time: Any = None) -> str:
    rows = [head]
    for k, width in enumerate((5.0, 8.0, 10.0)):
        for x in np.linspace(0, width, 20):
            t = k if time is None else time[k]
            rows.append(f"{t},{factor * x:.9g},{factor * height(width, x):.9g}")
    path.write_text("\n".join(rows))
    return str(path)


def test_wrong_lines_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("1,2,3\n")
    with pytest.raises(DataFileError, match="must have the columns x, y, got 1, 2, 3"):
        read(arrays(), surface=str(tmp_path / "a.csv"), **MATERIAL)
    late = line_file(tmp_path / "b.csv", "t,x,y", time=T + 100)
    with pytest.raises(DataFileError, match="given between the times 1 and 3 of the vectors"):
        read(masked(), surface=late, **MATERIAL)
    with pytest.raises(DataFileError, match="c.csv: there is no such file"):
        read(masked(), surface=str(tmp_path / "c.csv"), **MATERIAL)


def test_vectors_alone_give_grains_but_no_surface() -> None:
    """Gaps of up to two cells are grains without a vector; what lies outside is air."""
    u = arrays()["u"].copy()
    u[0, 1, 1] = np.nan
    with pytest.warns(FlowFileWarning, match="the free surface is not known"):
        flow = read(arrays(u=u, validity=np.where(np.isnan(u), 3, 1)), **MATERIAL)
    assert flow.surface is None
    assert flow.c[0, 1, 1] == 1
    np.testing.assert_array_equal(flow.c[:2, :, -1], 0)
    assert (flow.c == 1).sum() <= (C > 0).sum() + 4
