"""Every column is converted by its own unit, in tables, files of programs and data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granpinn
from granpinn.importers import DataFileError, read, read_vectors
from tests.importers.test_columns import GRAINS, QUIET, head_of, lines
from tests.importers.test_in_memory import MATERIAL, dataset, same
from tests.importers.test_other_piv import davis, insight
from tests.importers.test_pivlab_text import export
from tests.importers.test_tracks import motion, write_csv

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
    with pytest.raises(DataFileError, match="--origin must not be given where columns have"):
        read(path, origin="1,2", **QUIET, **GRAINS)
    line = lines(tmp_path / "line.csv", "t [s],x,y [mm]", "0,1,30", "0.01,20,30")
    with pytest.raises(DataFileError, match="line.csv: x must state its unit of length, as the"):
        read(path, **QUIET | GRAINS | {"surface": line})
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
