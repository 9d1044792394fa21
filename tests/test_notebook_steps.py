"""The steps of a notebook, from arrays to another equation, with the names of the top level only.

Every network is tiny: what a step returns counts, not how accurate it is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
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


def test_6_a_result_is_saved_and_loaded(result: granpinn.Identification, tmp_path: Path) -> None:
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


def test_7_predict_inside_and_outside(result: granpinn.Identification) -> None:
    inside = np.argwhere(result.fields.c.values == 1)[0]
    t, y, x = (result.fields[axis].values[k] for axis, k in zip("tyx", inside, strict=True))
    far = [x, 1000.0]
    assert np.isfinite(result.predict(far, y, t)["u"]).tolist() == [True, False]
    assert np.isfinite(result.network.predict(far, y, t)["u"]).all()


def test_8_plot(result: granpinn.Identification) -> None:
    assert result.plot.law().get_xlabel()


def test_9_many_flows_are_identifications(flow: Any) -> None:
    found = granpinn.identify_many([flow, flow], TINY, seeds=[1, 2], checks="none")
    assert [type(one) for one in found] == [granpinn.Identification] * 2
    assert found[0].fields.u.shape == found[1].fields.u.shape


def test_10_a_law_of_your_own(flow: Any) -> None:
    def mu(I: Any, theta: Any) -> Any:
        mu_s, rise = theta
        return mu_s + rise * (1 - torch.exp(-I / 0.2))

    parts = [granpinn.laws.Parameter("mu_s", 0.3), granpinn.laws.Parameter("rise", 0.3)]
    law = granpinn.laws.Law("notebook_law", mu, parts)
    found = granpinn.identify(flow, TINY, law=law, checks="none")
    assert [*found.parameters] == ["mu_s", "rise"]
    named = granpinn.identify(flow, TINY, law="coulomb", checks="none")
    assert [*named.parameters] == ["mu_s"]


def test_11_jets_of_another_equation() -> None:
    network = granpinn.SwishNetwork(outputs=1, hidden=(8, 8), lower=(0, 0, 0), upper=(1, 1, 1))
    jet = network.jet(torch.rand(5, 3), 2)
    assert all(torch.isfinite(part).all() for part in jet)


def test_12_a_callback_gets_the_values_early(flow: Any, tmp_path: Path) -> None:
    values: list[granpinn.Result] = []
    found = granpinn.identify(flow, TINY, run_dir=tmp_path, on_values=values.append)
    assert values[0].checks == {}
    assert values[-1].parameters == found.parameters
