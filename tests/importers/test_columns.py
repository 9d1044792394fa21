"""Tables: a column is found by its name, and a file has one dialect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import granpinn
from granpinn.importers import DataFileError, read, read_vectors
from granpinn.importers.columns import Column, header
from tests.importers import scene
from tests.importers.test_in_memory import MATERIAL, UNITS, arrays
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import basilisk
from tests.importers.test_surface import PHYSICAL, in_pixels

GRAINS = {"grain_diameter": "2 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}


def lines(path: Path, *content: str) -> str:
    path.write_text("\n".join(content) + "\n")
    return str(path)


def series(folder: Path) -> list[Path]:
    return [export(folder / f"PIV_{k}.txt", k) for k in range(3)]


CAMERA = {"scale": "0.5 mm/px", "pulse_delay": "1 ms", **GRAINS}


def test_times_without_a_unit_are_no_numbers_of_frames(tmp_path: Path) -> None:
    """Whatever the frames of the vectors are called; a setting states the unit."""
    given = lines(tmp_path / "times.csv", "10", "20", "40")
    vectors = in_pixels(time_unit="frames", velocity_unit="px/s")
    settings = PHYSICAL | {"surface": "none", "times": given}
    with pytest.raises(DataFileError, match=r"time_unit \(the files do not say the unit of t\)"):
        read(vectors, **settings)
    flow = read(vectors, **settings, time_unit="ms")
    np.testing.assert_allclose(flow.t, [0.01, 0.02, 0.04])


NO_TIMES = {
    "decimal commas between commas": (["t [s]", "0,010", "0,020", "0,030"], "a comma both"),
    "several columns": (["frame;temps [s]", "1;0,5", "2;0,6", "3;0,7"], "must have the columns t"),
    "no header": (["1,0.5", "2,0.6", "3,0.7"], "must have the columns t, got 1, 0.5"),
    "two times": (["t [s],time [ms]", "1,2", "2,3", "3,4"], "one column for t, got t, time"),
    "more cells": (
        ["t [s],frame", "1,5,0", "2,5,1", "3,5,2"],
        "must have 2 cells in every row",
    ),
    "comma and point": (["t [s];frame", "1,5;0", "2.5;1", "3,5;2"], "two decimal signs"),
    "thousands": (["t [s];frame", "1.000,5;0", "2;1", "3;2"], "two decimal signs"),
    "commas and blanks": (
        ["# t [s] frame [-]", "1,5 0", "2,5 1", "3,5 2"],
        "must have the columns t",
    ),
    "a frame in ms": (["t [s],frame [ms]", "1,0", "2,1", "3,2"], "plain numbers without a unit as"),
    "no time": (["t [s],frame", "1,0", ",1", "3,2"], "finite t"),
}


@pytest.mark.parametrize("name", NO_TIMES)
def test_times_that_can_be_read_in_two_ways_are_refused(tmp_path: Path, name: str) -> None:
    content, message = NO_TIMES[name]
    with pytest.raises(DataFileError, match=message):
        read(series(tmp_path), times=lines(tmp_path / "times.csv", *content), **CAMERA)


NO_SURFACE = {
    "decimal commas": (["frame,x [mm],y [mm]", "0,1,5,6,5"], "must have 3 cells in every row"),
    "x twice": (["t,x,x_position,y", "0,1,2,3"], "must have one column for x, got x, x_position"),
    "a time for a length": (["frame,x [s],y", "0,1,2"], "must be a unit of length"),
    "no number": (["frame;x;y", "0;1,5,5;2"], "got '1,5,5' in row 1"),
}


@pytest.mark.parametrize("name", NO_SURFACE)
def test_points_that_can_be_read_in_two_ways_are_refused(tmp_path: Path, name: str) -> None:
    content, message = NO_SURFACE[name]
    line = lines(tmp_path / "line.csv", *content)
    with pytest.raises(DataFileError, match=message):
        read(in_pixels(), **PHYSICAL | {"surface": line})


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("x [px],y [px],a [px/frame],b [px/frame],Vector type [-]", "must have the columns u, v"),
        ("x [px],y [px],u [px/frame],u [px/frame],v", "must have one column for u, got u, u"),
        ("x [px],y [px],u [px/frame],v [px/frame]", "must have 4 cells in every row"),
        ("x,y,u,v,t\nx,y,v,u,t", "must have numbers in column 1"),
    ],
)
def test_headers_that_do_not_name_the_columns_are_refused(
    tmp_path: Path, head: str, message: str
) -> None:
    path = export(tmp_path / "a.txt")
    first, second, _, *rows = path.read_text().splitlines()
    with pytest.raises(DataFileError, match=message):
        read_vectors(scene.write_lines(path, [first, second, head, *rows]))


@pytest.mark.parametrize(("scale", "offset"), [(100, 0), (255, 0), (1.01, 0), (1, -1.2)])
def test_a_fraction_beyond_0_and_1_is_refused(tmp_path: Path, scale: float, offset: float) -> None:
    given = arrays()
    c = given["c"] * scale + offset
    with pytest.raises(DataFileError, match="c must be a volume fraction from 0 to 1"):
        granpinn.flow(**given | {"c": c}, **UNITS, **MATERIAL)
    path = basilisk(tmp_path / "a.txt")
    rows = path.read_text().splitlines()
    cells = [row.split() for row in rows[1:]]
    changed = [[*r[:2], str(float(r[2]) * scale + offset), *r[3:]] if r else r for r in cells]
    with pytest.raises(DataFileError, match="c must be a volume fraction"):
        read_vectors(scene.write_lines(path, [rows[0], *map(" ".join, changed)]))


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("x [mm],Y (um)", [("x", "mm"), ("y", "um")]),
        ("\ufeff# x\ty [m]", [("x", ""), ("y", "m")]),
        ("x [px] y [px] Vector type [-] isNaN?",
         [("x", "px"), ("y", "px"), ("vector type", "-"), ("isnan?", "")]),
        ('"x";"y; z [m]";', [("x", ""), ("y; z", "m")]),
        ('x,"y', []),
        ("shear rate (of a tensor) [1/s],x", [("shear rate (of a tensor) [1/s]", ""), ("x", "")]),
    ],
)  # fmt: skip
def test_names_and_units_of_a_header(line: str, expected: list[tuple[str, str]]) -> None:
    assert header(line) == [Column(*pair) for pair in expected]
