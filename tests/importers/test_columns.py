"""Tables: a column is found by its name and converted by its own unit, in one dialect a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granpinn
from granpinn.importers import DataFileError, read, read_vectors
from granpinn.importers.columns import Column, header
from tests.importers import scene
from tests.importers.test_in_memory import MATERIAL, UNITS, arrays, dataset, same
from tests.importers.test_other_piv import davis, insight
from tests.importers.test_pivlab_text import export
from tests.importers.test_simulation_files import basilisk
from tests.importers.test_surface import PHYSICAL, in_pixels
from tests.importers.test_tracks import motion, write_csv

GRAINS = {"grain_diameter": "2 mm", "grain_density": "2500 kg/m^3", "solid_fraction": 0.6}
QUIET = {"surface": "none", "flip_y": "no"}


def lines(path: Path, *content: str) -> str:
    path.write_text("\n".join(content) + "\n")
    return str(path)


# Tracks of two grains: x from 1 mm by 2 mm a frame of 2 ms, y from 5 mm by 3 mm.
ROWS = [
    (0.002 * k, 1 + 2 * k + 9 * p, 5 + 3 * k, 1.0, 1.5, 0.01, 0.02, p)
    for k in range(6)
    for p in range(2)
]
COLUMNS = ("t", "x", "y", "u", "v", "sigma_u", "sigma_v", "particle")
BASE = dict(zip(COLUMNS, ("s", "mm", "mm", "m/s", "m/s", "m/s", "m/s", ""), strict=True))


def table(path: Path, changes: dict[str, tuple[str, float]], names: Any = COLUMNS) -> str:
    """The tracks with some columns in other units, and numbers that are that many times larger."""
    rows = [",".join(f"{n} [{changes.get(n, (BASE[n],))[0]}]" if BASE[n] else n for n in names)]
    for row in ROWS:
        cells = dict(zip(COLUMNS, row, strict=True))
        rows.append(",".join(repr(cells[n] * changes.get(n, ("", 1))[1]) for n in names))
    return lines(path, *rows)


OWN_UNITS: dict[str, dict[str, tuple[str, float]]] = {
    "t": {"t": ("ms", 1e3)},
    "y": {"y": ("m", 1e-3)},
    "x and y": {"x": ("cm", 0.1), "y": ("um", 1e3)},
    "v": {"v": ("mm/s", 1e3)},
    "sigma_u": {"sigma_u": ("mm/s", 1e3)},
    "sigma_v": {"sigma_v": ("mm/ms", 1)},
}


@pytest.mark.parametrize("name", OWN_UNITS)
def test_every_column_of_a_table_has_its_own_unit(tmp_path: Path, name: str) -> None:
    one, other = (
        read(table(tmp_path / f"{k}.csv", changes), **QUIET, **GRAINS)
        for k, changes in enumerate(({}, OWN_UNITS[name]))
    )
    assert one.particles is not None
    assert other.particles is not None
    for part, values in vars(one.particles).items():
        np.testing.assert_allclose(getattr(other.particles, part), values, rtol=1e-6)


def test_a_column_without_a_unit_has_that_of_the_others(tmp_path: Path) -> None:
    named = Path(table(tmp_path / "a.csv", {}))
    bare = lines(tmp_path / "b.csv", *named.read_text().replace("y [mm]", "y").splitlines())
    one, other = (read(str(path), **QUIET, **GRAINS) for path in (named, bare))
    np.testing.assert_array_equal(one.particles.y, other.particles.y)  # type: ignore[union-attr]


def test_uncertainties_of_positions_have_their_own_unit(tmp_path: Path) -> None:
    columns = motion(0.05, tracks=20)
    sizes = {"ep [mm]": 0.05 + 0 * columns["x"]}, {"ep [um]": 50 + 0 * columns["x"]}
    named = {f"{n} [mm]" if n in "xy" else n: values for n, values in columns.items()}
    given = {"frame_rate": "10 Hz", **QUIET, **GRAINS}
    one, other = (
        read(write_csv(tmp_path / f"{k}.csv", named | size), **given)
        for k, size in enumerate(sizes)
    )
    assert one.particles is not None
    assert other.particles is not None
    np.testing.assert_allclose(other.particles.sigma_u, one.particles.sigma_u, rtol=1e-6)


def test_a_window_counts_frames_in_every_unit_of_time(tmp_path: Path) -> None:
    names = [name for name in COLUMNS if name not in ("u", "v")]
    flows = [
        read(table(tmp_path / f"{unit}.csv", {"t": (unit, size)}, names), **QUIET, **GRAINS)
        for unit, size in (("s", 1), ("ms", 1e3), ("us", 1e6), ("hour", 1 / 3600))
    ]
    for flow in flows:
        assert flow.particles is not None
        np.testing.assert_allclose(flow.particles.u, 1.0, rtol=1e-6)
        np.testing.assert_allclose(flow.particles.v, 1.5, rtol=1e-6)


def test_velocities_of_tracks_follow_the_units_of_their_positions(tmp_path: Path) -> None:
    """Also where a setting states these units, and without dimensions."""
    columns = motion(tracks=20)
    path = write_csv(tmp_path / "a.csv", columns)
    shared: dict[str, Any] = {**QUIET, **GRAINS}
    cases = [
        (path, {"length_unit": "mm", "frame_rate": "100 Hz", "pulse_delay": "1 ms"}, 0.1),
        (path, {"length_unit": "mm", "time_unit": "ms"}, 1.0),
        (path, {"dimensionless": True, "frame_rate": "100", "grain_diameter": "2"}, 100.0),
    ]
    stated = {"x [m]": columns["x"], "y [m]": columns["y"], "t [s]": columns["frame"]}
    stated["particle"] = columns["particle"]
    own = write_csv(tmp_path / "b.csv", stated)
    cases += [(own, {"length_unit": "mm"}, 1e-3), (own, {"time_unit": "ms"}, 1e3)]
    for file, settings, speed in cases:
        plain = QUIET if "dimensionless" in settings else shared
        flow = read(file, **plain | settings)
        assert flow.particles is not None
        np.testing.assert_allclose(flow.particles.v, 0.5 * speed, rtol=1e-6)
    with pytest.raises(DataFileError, match="--velocity-unit must be the unit of x and y over"):
        read(own, velocity_unit="mm/s", **shared)
    times = lines(tmp_path / "t.txt", "t [s]", *map(str, range(12)))
    with pytest.raises(DataFileError, match="--times must not be given for tracks"):
        read(path, length_unit="mm", times=times, **shared)


def head_of(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


HEADERS: dict[str, tuple[Any, str, str, dict[str, float]]] = {
    "insight v": (lambda p: insight(p, unit="m/s"), '"V m/s"', '"V mm/s"', {"v": 1e-3}),
    "insight y": (lambda p: insight(p, unit="m/s"), '"Y mm"', '"Y um"', {"y": 1e-3}),
    "davis v": (davis, '"velocity" "m/s"', '"velocity" "m/s" "velocity" "mm/s"', {"v": 1e-3}),
    "davis y": (davis, '"mm" "position" "mm"', '"mm" "position" "m"', {"y": 1e3}),
    "pivlab v": (lambda p: export(p, calibration=(1e-3, 1)), "v [m/s]", "v [mm/s]", {"v": 1e-3}),
    "pivlab y": (lambda p: export(p, calibration=(1e-3, 1)), "y [m]", "y [mm]", {"y": 1e-3}),
}


@pytest.mark.parametrize("name", HEADERS)
def test_every_column_of_a_program_has_its_own_unit(tmp_path: Path, name: str) -> None:
    write, old, new, factors = HEADERS[name]
    path = write(tmp_path / ("a.vec" if "insight" in name else "a.txt"))
    one = read_vectors(path)
    other = read_vectors(head_of(path, old, new))
    assert (other.length_unit, other.velocity_unit) == (one.length_unit, one.velocity_unit)
    for column in "xyuv":
        expected = getattr(one, column) * factors.get(column, 1.0)
        np.testing.assert_allclose(getattr(other, column), expected, rtol=1e-9)


MIXED: list[tuple[Any, str, str]] = [
    (lambda p: insight(p, unit="m/s"), '"U m/s"', '"U pixel"'),
    (insight, '"Y mm"', '"Y pixel"'),
    (davis, '"mm" "position" "mm"', '"mm" "position" "px"'),
    (lambda p: export(p, calibration=(1e-3, 1)), "y [m]", "y [px]"),
    (lambda p: export(p, calibration=(1e-3, 1)), "v [m/s]", "v [px/frame]"),
    (lambda p: export(p, calibration=(1e-3, 1)), "v [m/s]", "v [furlongs/]"),
]


@pytest.mark.parametrize(("write", "old", "new"), MIXED)
def test_units_that_do_not_convert_are_refused(
    tmp_path: Path, write: Any, old: str, new: str
) -> None:
    path = head_of(write(tmp_path / "a.txt"), old, new)
    with pytest.raises(DataFileError, match="must have a unit that converts|must be a unit such"):
        read_vectors(path)


def test_a_setting_cannot_replace_several_units(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", OWN_UNITS["y"])
    with pytest.raises(DataFileError, match=r"--length-unit must not .* got x \[mm\], y \[m\]"):
        read(path, length_unit="mm", **QUIET, **GRAINS)
    other = table(tmp_path / "b.csv", {"t": ("s", 1)})
    with pytest.raises(DataFileError, match=r"must have the length unit x \[mm\], y \[m\] of"):
        read([path, other], **QUIET, **GRAINS)


@pytest.mark.parametrize(
    "changes",
    [{"y": ("m", 1e-3)}, {"v": ("m/s", 1e-2)}, {"u": ("mm/s", 10)}, {"t": ("ms", 1e3)}],
    ids=repr,
)
def test_every_variable_of_a_data_set_has_its_own_unit(
    tmp_path: Path, changes: dict[str, tuple[str, float]]
) -> None:
    data = dataset()
    for name, (unit, size) in changes.items():
        data[name] = (data[name].dims, data[name].values * size, {"units": unit})
    same(granpinn.flow(data, **MATERIAL))
    data.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    same(read(tmp_path / "a.nc", flip_y="no", **MATERIAL))


def test_data_sets_whose_units_cannot_be_used_are_refused() -> None:
    for name, unit in (("y", "px"), ("v", "px/dt"), ("c", "%"), ("u", "mm")):
        data = dataset()
        data[name].attrs["units"] = unit
        with pytest.raises(DataFileError, match=f"{name}|unit"):
            granpinn.flow(data, **MATERIAL)
    data = dataset()
    del data.t.attrs["units"]
    with pytest.raises(DataFileError, match=r"--time-unit \(the files do not say the unit of t\)"):
        granpinn.flow(data, **MATERIAL)


def series(folder: Path) -> list[Path]:
    return [export(folder / f"PIV_{k}.txt", k) for k in range(3)]


CAMERA = {"scale": "0.5 mm/px", "pulse_delay": "1 ms", **GRAINS}
TIMES = {
    "one column": ["Zeit [ms]", "10", "20", "40"],
    "decimal commas": ["frame;t [ms]", "0;10,0", "1;20,0", "2;40,0"],
    "tabs": ["t [s]\tnote", "0,010\ta", "0,020\tb.c", "0,040\t"],
    "other columns first": ["trigger [s],t [ms]", "7,10", "8,20", "9,40"],
    "other columns last": ["t [ms],delay [us]", "10,5", "20,6", "40,7"],
    "blanks": ["# frame [-] t [ms]", "0 10", "1 20", "2 40"],
    "frames in another order": ["frame,t [ms]", "2,40", "0,10", "1,20"],
    "quotes": ['"frame","t [ms]"', '"0","10"', '"1","20"', '"2","40"'],
}


@pytest.mark.parametrize("name", TIMES)
def test_times_are_those_of_the_column_t(tmp_path: Path, name: str) -> None:
    given = lines(tmp_path / "times.csv", *TIMES[name])
    flow = read(series(tmp_path), times=given, **CAMERA)
    np.testing.assert_allclose(flow.t, [0.01, 0.02, 0.04])


NO_TIMES = {
    "decimal commas between commas": (["Zeit [s]", "0,010", "0,020", "0,030"], "separate columns"),
    "several columns": (["frame;temps [s]", "1;0,5", "2;0,6", "3;0,7"], "must have the columns t"),
    "no header": (["1,0.5", "2,0.6", "3,0.7"], "must hold one number in every row, got 2"),
    "two times": (["t [s],time [ms]", "1,2", "2,3", "3,4"], "one column for t, got t, time"),
    "more cells": (["t [s],frame", "1,5,0", "2,5,1", "3,5,2"], "expected 2 cells as above, got 3"),
    "comma and point": (["t [s];frame", "1,5;0", "2.5;1", "3,5;2"], "expected one decimal sign"),
    "thousands": (["t [s];frame", "1.000,5;0", "2;1", "3;2"], "expected one decimal sign"),
    "commas and blanks": (
        ["# t [s] frame [-]", "1,5 0", "2,5 1", "3,5 2"],
        "separate columns with",
    ),
    "a frame in ms": (["t [s],frame [ms]", "1,0", "2,1", "3,2"], "plain numbers without a unit as"),
    "no time": (["t [s],frame", "1,0", ",1", "3,2"], "finite t"),
}


@pytest.mark.parametrize("name", NO_TIMES)
def test_times_that_can_be_read_in_two_ways_are_refused(tmp_path: Path, name: str) -> None:
    content, message = NO_TIMES[name]
    with pytest.raises(DataFileError, match=message):
        read(series(tmp_path), times=lines(tmp_path / "times.csv", *content), **CAMERA)


SURFACES = {
    "plain": ("t [ms],x [mm],y [mm]", "{ms},{x},{y}"),
    "decimal commas": ("frame;x [mm];y [mm]", "{frame};{x};{y}"),
    "tabs": ("frame\tx [mm]\ty [mm]", "{frame}\t{x}\t{y}"),
    "own units": ("y [um],t [s],x [m]", "{y}e3,{ms}e-3,{x}e-3"),
    "pixels": ("frame,x [px],y", "{frame},{x},{y}"),
    "cells at the end": ("t [ms],x [mm],y [mm],", "{ms},{x},{y},"),
}


@pytest.mark.parametrize("name", SURFACES)
def test_points_of_the_surface_in_every_dialect_and_unit(tmp_path: Path, name: str) -> None:
    head, row = SURFACES[name]
    points = [(frame, x) for frame in (0, 2) for x in (15.5, 90.25)]
    rows = [row.format(frame=frame, ms=10 * frame, x=x, y=65.5) for frame, x in points]
    if "commas" in name or name == "tabs":
        rows = [text.replace(".", ",") for text in rows]
    flow = read(
        in_pixels(y_down=False),
        **PHYSICAL | {"surface": lines(tmp_path / "line.csv", head, *rows), "start": "0 ms"},
    )
    assert flow.surface is not None
    np.testing.assert_allclose(flow.surface.t, [0, 0, 0.02, 0.02], atol=1e-12)
    np.testing.assert_allclose(flow.surface.x, [0.0155, 0.09025] * 2, rtol=1e-9)
    np.testing.assert_allclose(flow.surface.y, 0.0655, rtol=1e-9)


def test_pixels_of_a_line_are_pixels_where_vectors_are_in_millimeters(tmp_path: Path) -> None:
    """And the numbers of frames are none where vectors have times."""
    given = arrays(**UNITS) | MATERIAL | {"scale": "2 mm/px"}
    line = lines(tmp_path / "a.csv", "t,x [px],y", "0.1,100,200", "1,100,200")
    surface = read_flow(given, line).surface
    assert surface is not None
    np.testing.assert_allclose([surface.x, surface.y], [[0.2] * 2] * 2)
    line = lines(tmp_path / "b.csv", "frame,x,y", "0,100,200", "1,100,200")
    with pytest.raises(DataFileError, match="must have a column t, as the vectors have times"):
        read_flow(given, line)


def read_flow(given: dict[str, Any], line: str) -> Any:
    settings = {k: v for k, v in given.items() if k in {*MATERIAL, "scale"}}
    return read({k: v for k, v in given.items() if k not in settings}, surface=line, **settings)


NO_SURFACE = {
    "decimal commas": (["frame,x [mm],y [mm]", "0,1,5,6,5"], "expected 3 cells as above, got 5"),
    "x twice": (["t,x,x_position,y", "0,1,2,3"], "must have one column for x, got x, x_position"),
    "a time for a length": (["frame,x [s],y", "0,1,2"], "must be a unit of length"),
    "no number": (["frame;x;y", "0;1,5,5;2"], "expected numbers, got '1.5.5'"),
}


@pytest.mark.parametrize("name", NO_SURFACE)
def test_points_that_can_be_read_in_two_ways_are_refused(tmp_path: Path, name: str) -> None:
    content, message = NO_SURFACE[name]
    line = lines(tmp_path / "line.csv", *content)
    with pytest.raises(DataFileError, match=message):
        read(in_pixels(), **PHYSICAL | {"surface": line})


def test_walls_in_every_dialect_and_unit(tmp_path: Path) -> None:
    settings = PHYSICAL | {"surface": "none"}
    plain = lines(tmp_path / "a.csv", "x [mm],y [mm],p", "0,8,1500", "90,8,1500")
    other = lines(tmp_path / "b.csv", "p [kPa];y [cm];x [px]", "1,5;0,8;0", "1,5;0,8;90")
    one, same = (read(in_pixels(), walls=path, **settings).walls for path in (plain, other))
    assert one is not None
    assert same is not None
    for name in ("x", "y", "p"):
        np.testing.assert_allclose(getattr(same, name), getattr(one, name), atol=1e-9)
    for head, message in (("p [mm]", "must be a unit of pressure"), ("slip [s]", "without a unit")):
        path = lines(tmp_path / "c.csv", f"x,y,{head}", "0,8,1", "90,8,1")
        with pytest.raises(DataFileError, match=message):
            read(in_pixels(), walls=path, **settings)


def test_tracks_with_decimal_commas(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", motion())
    comma = lines(
        tmp_path / "b.csv", *path.read_text().replace(",", ";").replace(".", ",").splitlines()
    )
    one, other = read_vectors(path), read_vectors(comma)
    np.testing.assert_array_equal(other.x, one.x)
    np.testing.assert_array_equal(other.u, one.u)


PIVLAB = {
    "swapped": "x [px],y [px],v [px/frame],u [px/frame],Vector type [-]",
    "types first": "Vector type [-],x [px],y [px],u [px/frame],v [px/frame]",
    "types in the middle": "x,y,Vector type,u,v",
}


@pytest.mark.parametrize("name", PIVLAB)
def test_pivlab_goes_by_the_names_of_its_header(tmp_path: Path, name: str) -> None:
    path = export(tmp_path / "a.txt")
    expected = read_vectors(path)
    first, second, old, *rows = path.read_text().splitlines()
    columns = [column.name for column in header(old)]
    order = [columns.index(column.name) for column in header(PIVLAB[name])]
    cells = [row.split(",") for row in rows]
    turned = [",".join(row[i] for i in order) for row in cells]
    found = read_vectors(scene.write_lines(path, [first, second, PIVLAB[name], *turned]))
    np.testing.assert_array_equal(found.u, expected.u)
    np.testing.assert_array_equal(found.v, expected.v)
    np.testing.assert_array_equal(found.validity, expected.validity)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("x [px],y [px],a [px/frame],b [px/frame],Vector type [-]", "must have the columns u, v"),
        ("x [px],y [px],u [px/frame],u [px/frame],v", "must have one column for u, got u, u"),
        ("x [px],y [px],u [px/frame],v [px/frame]", "expected 4 cells as above, got 5"),
        ("x,y,u,v,t\nx,y,v,u,t", "one line with the names of its columns"),
    ],
)
def test_headers_that_do_not_name_the_columns_are_refused(
    tmp_path: Path, head: str, message: str
) -> None:
    path = export(tmp_path / "a.txt")
    first, second, _, *rows = path.read_text().splitlines()
    with pytest.raises(DataFileError, match=message):
        read_vectors(scene.write_lines(path, [first, second, head, *rows]))


def test_fields_of_a_simulation_are_chosen_by_one_name(tmp_path: Path) -> None:
    path = basilisk(tmp_path / "a.txt")
    head_of(path, "4:p", "4:c")
    with pytest.raises(DataFileError, match="must have one column for c, got f, c"):
        read_vectors(path)
    named = read_vectors(path, options={"names": {"c": "f"}})
    assert named.c is not None
    with pytest.raises(DataFileError, match="must have the columns phi, got"):
        read_vectors(path, options={"names": {"c": "phi"}})


@pytest.mark.parametrize(
    ("scale", "offset", "cause"),
    [(100, 0, "per cent"), (255, 0, "grey levels"), (1.01, 0, "solver"), (1, -1.2, "solver")],
)
def test_a_fraction_beyond_0_and_1_is_refused(
    tmp_path: Path, scale: float, offset: float, cause: str
) -> None:
    given = arrays()
    c = given["c"] * scale + offset
    with pytest.raises(DataFileError, match=f"c must be a volume fraction from 0 to 1.*{cause}"):
        granpinn.flow(**given | {"c": c}, **UNITS, **MATERIAL)
    path = basilisk(tmp_path / "a.txt")
    rows = path.read_text().splitlines()
    cells = [row.split() for row in rows[1:]]
    changed = [[*r[:2], str(float(r[2]) * scale + offset), *r[3:]] if r else r for r in cells]
    with pytest.raises(DataFileError, match=f"c must be a volume fraction.*{cause}"):
        read_vectors(scene.write_lines(path, [rows[0], *map(" ".join, changed)]))


def test_rounding_beyond_0_and_1_is_none() -> None:
    given = arrays()
    rounded = given["c"] * (1 + 5e-7) - 2e-7
    flow = granpinn.flow(**given | {"c": rounded}, **UNITS, **MATERIAL)
    np.testing.assert_array_equal(flow.c == 1, given["c"] == 1)


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
