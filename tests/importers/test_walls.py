"""Walls from a table, in the units and axes of the vectors or in their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.data import FlowFileError, Walls, check_flow
from granpinn.importers import DataFileError, read
from tests.importers.test_surface import X, arrays

PLAIN: dict[str, Any] = {"dimensionless": True, "grain_diameter": "0.1", "surface": "none"}


def walls_of(path: Path, text: str, data: Any = None, settings: Any = None) -> Walls:
    (path / "walls.csv").write_text(text)
    data = (
        arrays(u=1.0 + X + np.zeros((3, 8, 10)), v=np.zeros((3, 8, 10))) if data is None else data
    )
    flow = read(data, walls=str(path / "walls.csv"), **(settings or PLAIN))
    check_flow(flow)
    assert flow.walls is not None
    return flow.walls


BROKEN = {
    "no columns": ("1,2\n3,4\n", "must have the columns x, y, got 1, 2"),
    "y missing": ("x,u\n1,2\n", "must have the columns y, got x, u"),
    "unknown": ("x,y,depth\n1,2,3\n", "must have a first line"),
    "twice": ("x,y,x\n1,2,3\n", "must have one column for x, got x, x"),
    "short rows": ("x,y,u,v\n1,2,3\n2,3,4\n", "must have 4 cells in every row"),
    "infinite": ("x,y\n1,2\n3,inf\n", "must have a finite y of at most"),
    "a unit of time": ("x [s],y\n1,2\n3,4\n", "x must be without a unit with dimensionless"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_broken_table(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match=message) as caught:
        walls_of(tmp_path, text)
    assert "walls.csv" in str(caught.value)


def test_one_point_is_no_wall(tmp_path: Path) -> None:
    with pytest.raises(FlowFileError, match="every piece of a wall must have at least two points"):
        walls_of(tmp_path, "x,y\n1,2\n")
