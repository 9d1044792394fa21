"""fields.h5: exact to write and read, also with h5py and xarray."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from granpinn.results import (
    Fields,
    FieldsFileError,
    read_fields,
    write_fields,
)
from granpinn.results.fields import VARIABLES
from tests.examples import make_fields
from tests.flows import make_flow

UNITS = {"velocity": "m/s", "rate": "1/s", "number": "1", "pressure": None, "viscosity": None}


def full() -> Fields:
    """Fields with all variables, each with its own values."""
    flow = make_flow(frames=3, rows=9, columns=7)
    n = int(flow.material.sum())
    rng = np.random.default_rng(3)
    return make_fields(flow, **{k: rng.normal(size=n) for k in VARIABLES if "reference" not in k})


@pytest.fixture
def fields() -> Fields:
    return full()


@pytest.fixture
def path(fields: Fields, tmp_path: Path) -> Path:
    path = tmp_path / "fields.h5"
    write_fields(fields, path)
    return path


# ---- in memory -----------------------------------------------------------------------------------


def test_a_frame_holds_the_values_of_its_points_and_nan_elsewhere(fields: Fields) -> None:
    assert fields.shape == fields.c.shape == (3, 9, 7)
    inside = fields.c == 1
    assert 0 < inside.sum() < inside.size
    grid = np.stack([fields.frame("p", k) for k in range(3)])
    assert grid.dtype == np.float32
    np.testing.assert_array_equal(np.isnan(grid), ~inside)
    np.testing.assert_array_equal(grid[inside], fields.values["p"])


# ---- the file ------------------------------------------------------------------------------------


@pytest.mark.parametrize("known_pressure", [True, False])
def test_what_is_written_comes_back(known_pressure: bool, fields: Fields, tmp_path: Path) -> None:
    if not known_pressure:
        fields = replace(fields, values={k: v for k, v in fields.values.items() if k[:2] != "p_"})
    write_fields(fields, tmp_path / "fields.h5")
    back = read_fields(str(tmp_path / "fields.h5"))
    for name in ("t", "y", "x", "c"):
        found, written = getattr(back, name), getattr(fields, name)
        assert found.dtype == written.dtype
        np.testing.assert_array_equal(found, written)
    assert list(back.values) == [name for name in VARIABLES if name in fields.values]
    for name, value in fields.values.items():
        assert back.values[name].dtype == np.float32
        np.testing.assert_array_equal(back.values[name], value)
    assert back.units == fields.units
    assert (back.length, back.time) == (fields.length, fields.time)
    assert back.pressure == fields.pressure


def test_a_vector_that_is_missing_in_the_flow_stays_missing(tmp_path: Path) -> None:
    flow = make_flow(frames=2)
    u = flow.u.copy()
    u[0, 0, 0] = np.nan
    assert flow.c[0, 0, 0] == 1
    fields = make_fields(replace(flow, u=u), u=1.0)
    write_fields(fields, tmp_path / "fields.h5")
    back = read_fields(tmp_path / "fields.h5")
    assert np.isnan(back.frame("u_reference", 0)[0, 0])
    assert back.frame("u", 0)[0, 0] == 1


def test_h5py_finds_the_layout_of_a_flow_file(path: Path, fields: Fields) -> None:
    with h5py.File(path) as file:
        assert set(file) == {"t", "y", "x", "c", *VARIABLES}
        attributes = dict(file.attrs)
        assert attributes.pop("format_name") == b"granpinn-fields"
        assert attributes == {
            "format_version": 1,
            "length_unit": b"m",
            "time_unit": b"s",
            "length_scale": fields.length,
            "time_scale": fields.time,
            "pressure_scale": fields.pressure,
        }
        for name, unit in (("t", b"s"), ("y", b"m"), ("x", b"m")):
            assert file[name].dtype == np.float64
            assert file[name].is_scale
            assert file[name].attrs["units"] == unit
        for name, (kind, long_name) in VARIABLES.items():
            dataset = file[name]
            assert (dataset.dtype, dataset.shape) == (np.float32, fields.shape)
            assert [dimension[0].name for dimension in dataset.dims] == ["/t", "/y", "/x"]
            assert dataset.attrs["long_name"].decode() == long_name
            unit = dataset.attrs.get("units")
            assert (unit and unit.decode()) == UNITS[kind]
            np.testing.assert_array_equal(np.isnan(dataset[:]), file["c"][:] != 1)


def test_xarray_opens_it_with_coordinates_and_units(path: Path, fields: Fields) -> None:
    with xarray.open_dataset(path, engine="h5netcdf") as dataset:
        assert dict(dataset.sizes) == dict(zip("tyx", fields.shape, strict=True))
        assert set(dataset.coords) == {"t", "y", "x"}
        assert set(dataset.data_vars) == {"c", *VARIABLES}
        assert dataset["p"].dims == ("t", "y", "x")
        assert dataset["u"].attrs["units"] == "m/s"
        np.testing.assert_array_equal(dataset["t"], fields.t)
        frame = dataset["tau_xy"].sel(t=fields.t[1])
        np.testing.assert_array_equal(frame, fields.frame("tau_xy", 1))


# ---- files that are not right --------------------------------------------------------------------


def replace_dataset(name: str, value: object) -> Callable[[h5py.File], None]:
    def edit(file: h5py.File) -> None:
        del file[name]
        if value is not None:
            file[name] = value

    return edit


def change_attribute(name: str, value: object) -> Callable[[h5py.File], None]:
    def edit(file: h5py.File) -> None:
        if value is None:
            del file.attrs[name]
        else:
            file.attrs[name] = value

    return edit


DAMAGE = {
    "another version": (
        change_attribute("format_version", 2),
        "format_version must be 1, got 2",
    ),
    "another format": (
        change_attribute("format_name", np.bytes_(b"granpinn-flow")),
        "format_name must be 'granpinn-fields', got 'granpinn-flow': read it with",
    ),
    "no format": (change_attribute("format_name", None), "format_name"),
    "version is text": (
        change_attribute("format_version", "one"),
        "format_version must be a number",
    ),
    "no unit": (change_attribute("length_unit", None), "length_unit"),
    "unit is not UTF-8": (
        change_attribute("time_unit", np.bytes_(b"\xff")),
        "time_unit must be one text, got text that is not UTF-8",
    ),
    "no scale": (change_attribute("time_scale", None), "time_scale"),
    "scale is text": (change_attribute("pressure_scale", "high"), "pressure_scale must be a num"),
    "no time": (replace_dataset("t", None), "t is missing: expected a dataset t float64"),
    "no grains": (replace_dataset("c", None), "c is missing: expected a dataset c float32"),
    "time is one number": (replace_dataset("t", 1.0), "fields.h5 could not be read"),
    "longer time": (
        replace_dataset("t", np.arange(4.0)),
        r"c must be \[T, Y, X\] = \[4, 9, 7\], got \[3, 9, 7\]",
    ),
    "narrower variable": (
        replace_dataset("p", np.zeros((3, 9, 6), np.float32)),
        r"p must be \[T, Y, X\] = \[3, 9, 7\], got \[3, 9, 6\]",
    ),
    "more frames of a variable": (
        replace_dataset("I", np.zeros((5, 9, 7), np.float32)),
        r"I must be \[T, Y, X\] = \[3, 9, 7\], got \[5, 9, 7\]",
    ),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_file_is_one_sentence(case: str, path: Path) -> None:
    edit, sentence = DAMAGE[case]
    with h5py.File(path, "r+") as file:
        edit(file)
    with pytest.raises(FieldsFileError, match=sentence) as caught:
        read_fields(path)
    assert str(caught.value).startswith(f"{path} could not be read as granpinn-fields: ")
