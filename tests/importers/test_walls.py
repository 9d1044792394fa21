"""Walls from a table, in the units and axes of the vectors or in their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.data import FlowFileError, Walls, check_flow
from granpinn.importers import DataFileError, read
from tests.importers.test_surface import PHYSICAL, X, arrays, in_pixels

PLAIN: dict[str, Any] = {"dimensionless": True, "grain_diameter": "0.1", "surface": "none"}
CAMERA = PHYSICAL | {"surface": "none"}


def walls_of(path: Path, text: str, data: Any = None, settings: Any = None) -> Walls:
    (path / "walls.csv").write_text(text)
    data = (
        arrays(u=1.0 + X + np.zeros((3, 8, 10)), v=np.zeros((3, 8, 10))) if data is None else data
    )
    flow = read(data, walls=str(path / "walls.csv"), **(settings or PLAIN))
    check_flow(flow)
    assert flow.walls is not None
    return flow.walls


def test_pieces_motion_slip_and_pressure(tmp_path: Path) -> None:
    text = "x,y,slip,u,v,p\n0,0,0,0,0,nan\n10,0,0,0,0,nan\nnan,nan,nan,nan,nan,nan\n"
    walls = walls_of(tmp_path, text + "0,8,1,2,3,20\n10,8,1,2,3,20\n")
    np.testing.assert_array_equal(walls.x, [0, 10, np.nan, 0, 10])
    np.testing.assert_array_equal(walls.y, [0, 0, np.nan, 8, 8])
    np.testing.assert_array_equal(walls.slip, np.float32([0, 0, np.nan, 1, 1]))
    assert walls.u is not None
    assert walls.v is not None
    np.testing.assert_array_equal(walls.u[3:], [2, 2])
    np.testing.assert_array_equal(walls.v[3:], [3, 3])
    np.testing.assert_array_equal(walls.p, np.float32([np.nan, np.nan, np.nan, 20, 20]))
    assert walls.t is None


def test_pixels_of_an_image_point_down(tmp_path: Path) -> None:
    """The origin of an image is its lower left vector; y and v change their sign."""
    walls = walls_of(tmp_path, "x,y,u,v\n5,75,0,1\n95,75,0,1\n", in_pixels(), CAMERA)
    mm = walls_of(tmp_path, "x [px],y [px],u [px/frame],v\n5,75,0,1\n95,75,0,1\n", in_pixels(),
                  CAMERA)  # fmt: skip
    pixel = np.diff(walls.x)[0] / 90
    assert pixel > 0
    np.testing.assert_allclose(walls.y, 0, atol=1e-12)
    assert walls.v is not None
    assert (walls.v < 0).all()
    np.testing.assert_allclose(mm.x, walls.x, rtol=1e-12)
    np.testing.assert_allclose(mm.v, walls.v, rtol=1e-12)


def test_own_units(tmp_path: Path) -> None:
    text = "x [mm],y [mm],t [ms]\n0,0,15\n1,0,15\n"
    walls = walls_of(tmp_path, text, in_pixels(), CAMERA)
    np.testing.assert_allclose(np.diff(walls.x), 1e-3)
    np.testing.assert_allclose(walls.t, 0.015)


BROKEN = {
    "no columns": ("1,2\n3,4\n", "must have the columns x, y, got 1, 2"),
    "y missing": ("x,u\n1,2\n", "must have the columns y, got x, u"),
    "unknown": ("x,y,depth\n1,2,3\n", "must have a first line"),
    "twice": ("x,y,x\n1,2,3\n", "must have one column for x, got x, x"),
    "short rows": ("x,y,u,v\n1,2,3\n2,3,4\n", "line 2: expected 4 cells as above, got 3"),
    "infinite": ("x,y\n1,2\n3,inf\n", "must have a finite y of at most"),
    "a unit of time": ("x [s],y\n1,2\n3,4\n", "x must be without a unit with --dimensionless"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_broken_table(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match=message) as caught:
        walls_of(tmp_path, text)
    assert "walls.csv" in str(caught.value)


def test_one_point_is_no_wall(tmp_path: Path) -> None:
    with pytest.raises(FlowFileError, match="every piece of a wall must have at least two points"):
        walls_of(tmp_path, "x,y\n1,2\n")
