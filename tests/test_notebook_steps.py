"""The steps of a notebook, from arrays to a saved result, with the names of the top level only.

Every network is tiny: what a step returns counts, not how accurate it is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import granpinn
from tests.flows import make_flow

FLOW = make_flow()
MATERIAL = {
    "grain_diameter": "20 mm",
    "grain_density": "2500 kg/m^3",
    "solid_fraction": 0.6,
    "length_unit": "m",
    "time_unit": "s",
}
TINY: dict[str, Any] = {
    "steps": 20,
    "log_every": 5,
    "network": {"widths": (8, 8)},
    "batch": {"interior": 64, "surface": 16},
    "device": "cpu",
}


@pytest.fixture(scope="module")
def flow() -> Any:
    arrays = {name: getattr(FLOW, name) for name in "tyxuvc"}
    surface = FLOW.surface
    assert surface is not None
    line = (surface.t, surface.x, surface.y)
    return granpinn.flow(**arrays, surface=line, velocity_unit="m/s", **MATERIAL)


@pytest.fixture(scope="module")
def result(flow: Any) -> granpinn.Identification:
    return granpinn.identify(flow, TINY, level="V1", checks="quick")


def test_1_arrays_and_xarray_give_the_same_flow(flow: Any) -> None:
    axes = {name: (name, getattr(FLOW, name)) for name in "tyx"}
    data = {name: (("t", "y", "x"), getattr(FLOW, name)) for name in "uvc"}
    found = granpinn.flow(xarray.Dataset(data, axes), velocity_unit="m/s", **MATERIAL)
    for name in "uvc":
        np.testing.assert_array_equal(getattr(found, name), getattr(flow, name))


def test_2_files_are_read_and_converted(tmp_path: Path) -> None:
    arrays = {name: getattr(FLOW, name) for name in "tyxuvc"} | {"velocity_unit": "m/s"}
    np.savez(tmp_path / "vectors.npz", **{k: v for k, v in arrays.items() if k != "velocity_unit"})
    found = granpinn.read(tmp_path / "vectors.npz", velocity_unit="m/s", **MATERIAL)
    again = granpinn.convert(arrays, granpinn.importers.Settings(**MATERIAL))
    np.testing.assert_array_equal(found.u, again.u)


def test_3_inspect_says_what_to_expect(flow: Any) -> None:
    found = granpinn.inspect(flow)
    assert found["noise"].sigma >= 0
    assert found.lines()


def test_4_identify_takes_a_dict_and_single_settings(result: granpinn.Identification) -> None:
    assert (result.level, result.timing.steps) == ("V1", 20)
    assert result.settings["network"]["widths"] == (8, 8)
    assert result.assessment.grade in ("good", "care", "do not use")
    assert str(result).splitlines()[0].startswith("mu_s ")
    assert result.summary().splitlines()[-1] == f"assessment: {result.assessment}"


def test_5_a_result_is_saved_and_loaded(result: granpinn.Identification, tmp_path: Path) -> None:
    folder = result.save(tmp_path / "run")
    for place in (folder, folder / "results.json"):
        loaded = granpinn.load(place)
        assert loaded.to_dict() == result.to_dict()
        xarray.testing.assert_identical(loaded.fields, result.fields)
        for name, column in result.history.items():
            np.testing.assert_array_equal(loaded.history[name], column)
    with pytest.raises(ValueError, match="already holds a run"):
        result.save(folder)
    page = granpinn.load(folder).report()
    assert page == folder / "report.html"
    assert "mu(I)" in page.read_text(encoding="utf-8")
    with pytest.raises(ValueError, match=r"in memory: name a folder for the report"):
        result.report()
