"""What a notebook gets back: network, fields, history and figures, in memory and from a folder."""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
import pytest
import safetensors.torch as safetensors
import torch
from matplotlib import pyplot
from matplotlib.figure import Figure

import granpinn
from granpinn.data import Flow
from granpinn.fit.network_file import FILE, NetworkFileError, read_network
from granpinn.identification.identified import Identification
from granpinn.results import read_fields, read_results
from tests.flows import make_flow
from tests.runs import tiny

xarray = pytest.importorskip("xarray")


CONFIG = tiny(members=2)


class Run(NamedTuple):
    flow: Flow
    result: Identification
    folder: Path


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Two networks on a tilted flow, so that axes turn."""
    flow = make_flow(gravity=(0.5, -9.79), p=None)
    folder = tmp_path_factory.mktemp("identified")
    return Run(flow, granpinn.identify(flow, CONFIG, run_dir=folder), folder)


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    pyplot.close("all")


def test_a_run_folder_brings_network_fields_and_history_back(run: Run) -> None:
    """The same as a run without a folder has in memory."""
    loaded, kept = granpinn.load(run.folder), granpinn.identify(run.flow, CONFIG)
    assert loaded == read_results(run.folder / "results.json") == loaded
    assert loaded.parameters == kept.parameters == run.result.parameters
    xarray.testing.assert_identical(loaded.fields, kept.fields)
    there, here = loaded.network, kept.network
    assert (there.spec, there.physics, there.scales) == (here.spec, here.physics, here.scales)
    assert loaded.network.axes == kept.network.axes
    assert torch.equal(there.params, here.params)
    assert torch.equal(there.theta, here.theta)
    assert [*kept.history] == [*loaded.history]
    for name in kept.history.keys() - {"wall_s"}:
        np.testing.assert_array_equal(loaded.history[name], kept.history[name])


def test_there_is_no_prediction_outside_of_the_grains(run: Run) -> None:
    fields = run.result.fields
    axes = [fields[axis].values for axis in "tyx"]
    t, y, x = np.meshgrid(*axes, indexing="ij")
    found, everywhere = (of.predict(x, y, t) for of in (run.result, run.result.network))
    filled = fields.c.values >= 0.5
    assert 0 < filled.sum() < filled.size
    for name, values in found.items():
        assert np.isnan(values[~filled]).all()
        np.testing.assert_array_equal(values[filled], everywhere[name][filled])
    assert np.isfinite(everywhere["p"]).all()
    k, j, i = np.argwhere(filled)[0]
    place = {a: fields[a].values[n] for a, n in zip("tyx", (k, j, i), strict=True)}
    assert np.isfinite(run.result.predict(**place)["u"])
    for axis in "tyx":  # half a cell beyond the grid, the last frame, or in no place
        ends = fields[axis].values[[0, -1]]
        step = np.diff(fields[axis].values)[0]
        for beyond in (ends[0] - 0.51 * step, ends[1] + 0.51 * step, np.nan):
            assert np.isnan(run.result.predict(**place | {axis: beyond})["u"])


def test_fields_have_units_and_are_those_of_the_file(run: Run) -> None:
    fields = run.result.fields
    kept = read_fields(run.folder / "fields.h5")
    assert fields.sizes == {"t": 12, "y": 24, "x": 20}
    assert {axis: fields[axis].units for axis in "tyx"} == {"t": "s", "y": "m", "x": "m"}
    assert (fields.u.units, fields.I.units, fields.D2.units) == ("m/s", "1", "1/s")
    assert "units" not in fields.p.attrs  # the flow does not say the unit of its density
    for k in (0, 5, 11):
        np.testing.assert_array_equal(fields.p[k], kept.frame("p", k))
    np.testing.assert_array_equal(fields.c, kept.c)
    assert fields.attrs["length_scale"] == kept.length


def test_a_result_survives_pickling(run: Run) -> None:
    copied = pickle.loads(pickle.dumps(run.result))  # noqa: S301
    assert copied == run.result
    np.testing.assert_array_equal(copied.grid.values["p"], run.result.grid.values["p"])


def edited(content: bytes, **changes: object) -> bytes:
    """The file with other entries in its header."""
    length = int.from_bytes(content[:8], "little")
    text = json.loads(content[8 : 8 + length])["__metadata__"]["granpinn"]
    tensors = safetensors.load(content)
    for name in [*changes]:
        if name in tensors:
            tensors[name] = changes.pop(name)  # type: ignore[assignment]
    return safetensors.save(tensors, {"granpinn": json.dumps(json.loads(text) | changes)})


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"format_version": 1}, "expected granpinn-network version 2"),
        ({"law": "tresca"}, "the law tresca is not known"),
        ({"widths": [3, 4, 5]}, "do not fit"),
        ({"widths": ["3"]}, "widths"),
        ({"form": "weak"}, "weak"),
        ({"constants": ["grain_diameter"]}, "another version"),
        ({"scales": {"length": 1.0}}, "scales.velocity is missing"),
        ({"input_shift": [0.0]}, "input_shift must be a list of 3"),
        ({"nothing": 1}, "nothing is not known"),
        ({"params": torch.full((157,), torch.nan)}, "do not fit|NaN"),
        ({"theta": torch.zeros(3, dtype=torch.int64)}, "must be float32 or float64"),
        ({"physics": torch.zeros(())}, "iterable"),
    ],
    ids=str,
)
def test_a_wrong_network_file_is_refused_in_one_sentence(
    run: Run, tmp_path: Path, changes: dict[str, object], reason: str
) -> None:
    content = edited((run.folder / FILE).read_bytes(), **changes)
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(NetworkFileError, match=reason) as error:
        read_network(tmp_path / FILE)
    assert "\n" not in str(error.value)


def test_figures_are_on_the_axes_and_in_the_style_of_the_caller(run: Run, tmp_path: Path) -> None:
    with mpl.rc_context({"font.size": 17.0}):
        figure = Figure()
        own = figure.subplots(1, 2)
        assert run.result.plot.law(own[0]) is own[0]
        assert own[0].xaxis.label.get_size() == 17
        assert run.result.plot.fields(0.5, ["I"], own[1:])[0] is own[1]
    assert not pyplot.get_fignums()
    assert own[0].get_xlabel() == "inertial number $I$"
    figure.savefig(tmp_path / "both.svg")
    assert (tmp_path / "both.svg").read_text().lstrip().startswith("<?xml")


def test_every_figure_can_be_drawn(run: Run) -> None:
    plot = run.result.plot
    values, loss = plot.history()
    assert [line.get_label() for line in values.lines][:1] == [r"$\mu_s$"]
    assert loss.get_yscale() == "log"
    assert plot.fields(0.5, ["momentum_residual_x"])[0].get_title().startswith("$t$ = ")
