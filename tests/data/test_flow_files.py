"""Reading and writing: exact round trips, a layout that other tools understand, no half files."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from granpinn.data import (
    Flow,
    FlowFileError,
    Truth,
    read_flow,
    write_flow,
)
from granpinn.data.schema import arrays_of
from tests.data.walled import EVERYTHING, FLOOR, TWO
from tests.flows import make_flow


def with_field_of_sigma(flow: Flow) -> Flow:
    sigma = np.where(flow.material, 0.1, np.nan).astype(np.float32)
    return replace(flow, sigma_u=sigma, sigma_v=2 * sigma)


FLOWS = {
    "all": make_flow(),
    "least": make_flow(p=None, surface=None, eta_max=None, eta_min=None, truth=None, attributes={}),
    "surface without pressure": make_flow(surface=replace(make_flow().surface, p=None)),
    "sigma as a number": make_flow(sigma_u=0.01, sigma_v=1 / 3),
    "sigma as a field": with_field_of_sigma(make_flow()),
    "a part of the truth": make_flow(truth=Truth(mu_s=1 / 3)),
    "another law": make_flow(truth=Truth(1 / 3, law="coulomb")),
    "a law without parameters": make_flow(truth=Truth(law="coulomb")),
    "tilted": make_flow(gravity=(0.1, -9.0)),
    "floor": make_flow(walls=FLOOR),
    "two walls": make_flow(walls=TWO),
    "all of a wall": make_flow(walls=EVERYTHING),
    "attributes": make_flow(
        attributes={"source": "Grenoble, essai n°3 – 25 µm", "run": 7, "slope": 0.1, "note": ""}
    ),
}


@pytest.mark.parametrize("flow", FLOWS.values(), ids=FLOWS.keys())
def test_round_trip_is_exact(flow: Flow, tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    write_flow(flow, path)
    again = read_flow(path)
    before, after = arrays_of(flow), arrays_of(again)
    assert before.keys() == after.keys()
    for name, array in before.items():
        assert after[name].dtype == array.dtype, name
        assert after[name].tobytes() == array.tobytes(), name
    scalars = [f for f in vars(flow) if f not in (*before, "surface", "walls", "sha256", "path")]
    for name in scalars:
        assert getattr(again, name) == getattr(flow, name), name
    assert again.path == path
    assert again.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    write_flow(again, tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (b"coulomb", "the law coulomb has the parameters mu_s, got mu_2: leave it out"),
        (b"sand", "law must be one of mu_of_i, coulomb, regularised, power, cohesive, free, got"),
    ],
)
def test_law_that_does_not_fit_is_refused(law: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "flow.h5"
    write_flow(make_flow(truth=Truth(0.4, 0.64, 0.3)), path)
    with h5py.File(path, "r+") as file:
        file.attrs["true_law"] = np.bytes_(law)
    with pytest.raises(FlowFileError, match=re.escape(f"the true friction law: {message}")):
        read_flow(path)


def test_dimensions_and_units_in_xarray(tmp_path: Path) -> None:
    write_flow(make_flow(walls=FLOOR), tmp_path / "flow.h5")
    with xarray.open_dataset(tmp_path / "flow.h5", engine="h5netcdf") as dataset:
        assert dataset.u.dims == ("t", "y", "x")
        assert dataset.u.attrs["units"] == "m/s"
        assert dataset.t.attrs["units"] == "s"
        assert dataset.wall_x.attrs["units"] == "m"


def test_what_other_tools_add_is_kept_or_ignored(tmp_path: Path) -> None:
    """Other layouts and types of numbers are forms of tests/importers."""
    path = tmp_path / "flow.h5"
    write_flow(make_flow(), path)
    with h5py.File(path, "r+") as file:
        file["something_else"] = "not read"
        file.attrs["vector"] = [1.0, 2.0]
        file.attrs["note"] = "a string of variable length"
    note = {"note": "a string of variable length"}
    assert read_flow(path).attributes == {"source": "analytic spreading heap"} | note


def test_a_flow_that_breaks_a_rule_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(FlowFileError, match="density"):
        write_flow(make_flow(density=-1.0), tmp_path / "flow.h5")
    assert list(tmp_path.iterdir()) == []
