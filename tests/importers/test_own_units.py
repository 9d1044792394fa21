"""Every column is converted by its own unit, in tables, files of programs and data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granpinn
from granpinn.importers import DataFileError, read, read_vectors
from tests.importers.scene import METERS
from tests.importers.test_columns import GRAINS, QUIET, head_of, lines
from tests.importers.test_in_memory import MATERIAL, dataset
from tests.importers.test_other_piv import DAVIS, davis, insight
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


def test_a_column_without_a_unit_has_that_of_the_others(tmp_path: Path) -> None:
    named = Path(table(tmp_path / "a.csv", {}))
    bare = lines(tmp_path / "b.csv", *named.read_text().replace("y [mm]", "y").splitlines())
    one, other = (read(str(path), **QUIET, **GRAINS) for path in (named, bare))
    np.testing.assert_array_equal(one.particles.y, other.particles.y)  # type: ignore[union-attr]


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
    cases += [(own, {"length_unit": "mm", "force": True}, 1e-3)]
    cases += [(own, {"time_unit": "ms", "force": True}, 1e3)]
    for file, settings, speed in cases:
        plain = QUIET if "dimensionless" in settings else shared
        flow = read(file, **plain | settings)
        assert flow.particles is not None
        np.testing.assert_allclose(flow.particles.v, 0.5 * speed, rtol=1e-6)
    with pytest.raises(DataFileError, match="velocity_unit must be the unit of x and y over"):
        read(own, velocity_unit="mm/s", **shared)
    times = lines(tmp_path / "t.txt", "t [s]", *map(str, range(12)))
    with pytest.raises(DataFileError, match="times must not be given for tracks"):
        read(path, length_unit="mm", times=times, **shared)


MIXED: list[tuple[Any, str, str]] = [
    (lambda p: insight(p, view=DAVIS), '"U m/s"', '"U pixel"'),
    (insight, '"Y mm"', '"Y pixel"'),
    (davis, '"mm" "position" "mm"', '"mm" "position" "px"'),
    (lambda p: export(p, view=METERS), "y [m]", "y [px]"),
    (lambda p: export(p, view=METERS), "v [m/s]", "v [px/frame]"),
    (lambda p: export(p, view=METERS), "v [m/s]", "v [furlongs/]"),
]


@pytest.mark.parametrize(("write", "old", "new"), MIXED)
def test_units_that_do_not_convert_are_refused(
    tmp_path: Path, write: Any, old: str, new: str
) -> None:
    path = head_of(write(tmp_path / "a.txt"), old, new)
    with pytest.raises(DataFileError, match="must have a unit that converts|must be a unit such"):
        read_vectors(path)


def test_a_setting_cannot_replace_several_units(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", {"y": ("m", 1e-3)})
    with pytest.raises(DataFileError, match=r"length_unit must not .* got x \[mm\], y \[m\]"):
        read(path, length_unit="mm", **QUIET, **GRAINS)
    with pytest.raises(DataFileError, match="origin must not be given where columns have"):
        read(path, origin="1,2", **QUIET, **GRAINS)
    line = lines(tmp_path / "line.csv", "t [s],x,y [mm]", "0,1,30", "0.01,20,30")
    with pytest.raises(DataFileError, match="line.csv: x must state its unit of length, as the"):
        read(path, **QUIET | GRAINS | {"surface": line})
    other = table(tmp_path / "b.csv", {"t": ("s", 1)})
    with pytest.raises(DataFileError, match=r"must have the length unit x \[mm\], y \[m\] of"):
        read([path, other], **QUIET, **GRAINS)


def test_data_sets_whose_units_cannot_be_used_are_refused() -> None:
    for name, unit in (("y", "px"), ("v", "px/dt"), ("c", "%"), ("u", "mm")):
        data = dataset()
        data[name].attrs["units"] = unit
        with pytest.raises(DataFileError, match=f"{name}|unit"):
            granpinn.flow(data, **MATERIAL)
    data = dataset()
    del data.t.attrs["units"]
    with pytest.raises(DataFileError, match=r"time_unit \(the files do not say the unit of t\)"):
        granpinn.flow(data, **MATERIAL)
