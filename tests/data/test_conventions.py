"""CF attributes in flow files: granpinn and xarray read the same numbers, or granpinn refuses."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray

from granpinn.data import Flow, FlowFileError, particle_flow, read_flow, write_flow
from granpinn.data.flow import Particles
from granpinn.data.schema import DATASETS, arrays_of
from tests.flows import make_flow

# attribute, its value, and whether it changes nothing
ATTRIBUTES: list[tuple[str, Any, bool]] = [
    ("scale_factor", 1.5, False),
    ("scale_factor", np.float32(1), False),  # xarray rounds float64 by it
    ("scale_factor", np.bytes_(b"2"), False),
    ("add_offset", 1e-9, False),
    ("_FillValue", 0.0, False),
    ("_FillValue", np.nan, True),
    ("missing_value", -999.0, False),
    ("missing_value", [np.nan, 0.0], False),
    ("missing_value", np.nan, True),
    ("dtype", np.bytes_(b"bool"), False),
    ("units", np.bytes_(b"s since 2000-01-01"), False),
    ("units", np.bytes_(b"furlong"), False),
    ("units", "hour", False),
    ("units", 1.0, False),
    ("long_name", np.bytes_(b"what a figure says"), True),
]
NAMES = ("t", "x", "u", "v", "c", "p", "surface_t", "surface_y")


def scattered() -> Flow:
    rng = np.random.default_rng(7)
    t, x, y, u, v = (rng.random(400) for _ in range(5))
    particles = Particles(np.repeat([0.1, 0.2], 200), x + 0 * t, y, u, v)
    return particle_flow(
        particles, gravity=(0.0, -9.81), density=1500.0, grain_diameter=0.02, length_unit="m",
        time_unit="s",
    )  # fmt: skip


def read_both(path: Path) -> dict[str, tuple[Any, Any]]:
    """{dataset: (as granpinn reads it, as xarray reads it)}."""
    mine, theirs = arrays_of(read_flow(path)), {}
    with h5py.File(path) as file:
        groups = [name for name in file if isinstance(file[name], h5py.Group)]
    for group in ("", *groups):
        with xarray.open_dataset(path, group=group or None, engine="h5netcdf") as data:
            theirs |= {f"{group}/{k}".strip("/"): v.values for k, v in data.variables.items()}
    return {name: (values, theirs[name]) for name, values in mine.items()}


def assert_equal(both: dict[str, tuple[Any, Any]]) -> None:
    for name, (mine, theirs) in both.items():
        np.testing.assert_array_equal(mine, theirs, err_msg=name, strict=True)


@pytest.mark.parametrize(("attribute", "value", "neutral"), ATTRIBUTES)
@pytest.mark.parametrize("name", NAMES)
def test_attribute_is_refused_or_changes_nothing(
    name: str, attribute: str, value: Any, neutral: bool, tmp_path: Path
) -> None:
    path = tmp_path / "flow.h5"
    write_flow(make_flow(density_unit="kg/m^3"), path)
    with h5py.File(path, "r+") as file:
        file[name].attrs[attribute] = value
    if neutral:
        assert_equal(read_both(path))
        return
    with pytest.raises(FlowFileError, match=re.escape(attribute)):
        read_flow(path)


@pytest.mark.parametrize("flow", [make_flow(), make_flow(density_unit="kg/m^3"), scattered()])
@pytest.mark.parametrize("units", [("m", "s"), ("mm", "ms"), ("1", "1"), ("m", "1")])
def test_what_granpinn_writes_is_the_same_in_xarray(
    flow: Flow, units: tuple[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "flow.h5"
    object.__setattr__(flow, "length_unit", units[0])
    object.__setattr__(flow, "time_unit", units[1])
    write_flow(flow, path)
    assert_equal(read_both(path))


@pytest.mark.parametrize("name", [name for name in DATASETS if "particles" in name][:5])
def test_attributes_of_scattered_vectors_are_checked(name: str, tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    write_flow(scattered(), path)
    with h5py.File(path, "r+") as file:
        file[name].attrs["scale_factor"] = 2.0
    with pytest.raises(FlowFileError, match=f"{name} must be stored as it is"):
        read_flow(path)


@pytest.mark.parametrize(
    ("units", "accepted"),
    [("m/s", True), ("m s-1", True), ("m s^-1", True), ("m s**-1", True), ("mm/s", False),
     ("m/s2", False), ("", False)],
)  # fmt: skip
def test_unit_of_velocity(units: str, accepted: bool, tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    write_flow(make_flow(), path)
    with h5py.File(path, "r+") as file:
        file["u"].attrs["units"] = units  # h5py writes a string of variable length
    if accepted:
        assert_equal(read_both(path))
        return
    with pytest.raises(FlowFileError, match=re.escape("u must be in 'm/s' by length_unit")):
        read_flow(path)
