"""What a notebook gets back: network, fields, history and figures, in memory and from a folder."""

from __future__ import annotations

import dataclasses
import json
import pickle
import subprocess
import sys
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
from granpinn.errors import BadInput
from granpinn.fit.network import FILE, NetworkFileError, read_network
from granpinn.identification.batch import identify_many
from granpinn.identification.identified import Identification
from granpinn.results import FieldsFileError, Result, read_fields, read_results
from granpinn.training.history import HistoryFileError, read_history
from tests.flows import make_flow
from tests.runs import tiny

xarray = pytest.importorskip("xarray")


CONFIG = tiny(members=2, simulated_pressure__frames=2)


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
    there, here = loaded.network.model, kept.network.model
    assert (there.spec, there.physics, there.scales) == (here.spec, here.physics, here.scales)
    assert loaded.network.axes == kept.network.axes
    assert torch.equal(there.params, here.params)
    assert torch.equal(there.theta, here.theta)
    assert [*kept.history] == [*loaded.history]
    for name in kept.history.keys() - {"wall_s"}:
        np.testing.assert_array_equal(loaded.history[name], kept.history[name])


def test_a_prediction_at_a_grid_point_is_the_field_there(run: Run) -> None:
    fields, grid = run.result.fields, run.result.grid
    t, y, x = np.meshgrid(fields.t, fields.y, fields.x, indexing="ij")
    found = run.result.predict(x, y, t)
    for name, values in found.items():
        assert values.shape == grid.shape
        expected = fields[name].values
        inside = np.isfinite(expected)
        np.testing.assert_array_equal(values[inside], expected[inside])
    assert set(found) == {n for n in grid.values if "reference" not in n} - {"p_simulated"}
    assert run.result.predict(0.1, 0.2, [0.3, 0.4, 0.5])["p"].shape == (3,)


def test_there_is_no_prediction_outside_of_the_grains(run: Run) -> None:
    fields = run.result.fields
    axes = [fields[axis].values for axis in "tyx"]
    t, y, x = np.meshgrid(*axes, indexing="ij")
    found, everywhere = (run.result.predict(x, y, t, extrapolate=far) for far in (False, True))
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


def test_the_time_of_a_steady_flow_does_not_count(run: Run) -> None:
    grid = run.result.grid
    frames = dataclasses.replace(grid, t=grid.t[:1], c=grid.c[:1], steady=True)
    _, j, i = np.argwhere(grid.c[:1] == 1)[0]
    x, y = grid.x[i], grid.y[j]
    assert frames.inside(x, y, np.array([-5.0, grid.t[0], 99.0])).tolist() == [True] * 3


@pytest.mark.parametrize("place", [("a", 0, 0), ([1, 2], [1, 2, 3], 0), (None, {}, 0)])
def test_impossible_points_are_refused(run: Run, place: tuple[object, ...]) -> None:
    with pytest.raises(BadInput, match="x, y and t must be numbers"):
        run.result.predict(*place)  # type: ignore[arg-type]


def test_fields_have_units_and_are_those_of_the_file(run: Run) -> None:
    fields = run.result.fields
    kept = read_fields(run.folder / "fields.h5")
    assert fields.sizes == {"t": 12, "y": 24, "x": 20}
    assert {axis: fields[axis].units for axis in "tyx"} == {"t": "s", "y": "m", "x": "m"}
    assert (fields.u.units, fields.I.units, fields.D2.units) == ("m/s", "1", "1/s")
    assert "units" not in fields.p.attrs  # the flow does not say the unit of its density
    for k in (0, 5, 11):
        np.testing.assert_array_equal(fields.p_simulated[k], kept.frame("p_simulated", k))
    np.testing.assert_array_equal(fields.c, kept.c)
    assert fields.attrs["length_scale"] == kept.length


def test_history_is_that_of_the_file(run: Run) -> None:
    expected = read_history(run.folder / "history.csv")
    assert run.result.history["step"].tolist() == [*range(5, 45, 5)]
    for name, column in expected.items():
        np.testing.assert_array_equal(run.result.history[name], column)


def test_members_of_a_batch_have_their_own_fields(flow: Flow) -> None:
    config = tiny(steps=3, optimizer__prefit=0.0, simulated_pressure__frames=1)
    first, second = identify_many([flow, flow], config, [0, 1])
    assert isinstance(first, Identification)
    assert isinstance(second, Identification)
    for name in ("u", "p", "I"):
        assert np.isfinite(first.grid.values[name]).all()
        assert not np.array_equal(first.fields[name], second.fields[name], equal_nan=True)
    assert "p_simulated" not in second.fields


def test_members_are_draws(run: Run) -> None:
    tree = run.result.to_arviz()
    members = run.result.members
    assert members is not None
    posterior = tree["posterior"]
    assert posterior.sizes == {"chain": 1, "draw": 2}
    assert posterior.mu_s.values.tolist() == [list(members.values["mu_s"])]
    assert posterior.seed.values.tolist() == list(members.seed)
    alone = Identification.of(dataclasses.replace(run.result, members=None), run.result._held())
    with pytest.raises(ValueError, match="no members"):
        alone.to_arviz()


def test_a_changed_copy_has_no_parts(run: Run) -> None:
    changed = dataclasses.replace(run.result, level="V0")
    assert changed != run.result
    for name in ("network", "fields", "history"):
        with pytest.raises(BadInput, match="changed copy"):
            getattr(changed, name)


def test_a_result_survives_pickling(run: Run) -> None:
    copied = pickle.loads(pickle.dumps(run.result))  # noqa: S301
    assert copied == run.result
    np.testing.assert_array_equal(copied.grid.values["p"], run.result.grid.values["p"])


def test_only_the_part_that_is_missing_is_told(run: Run, tmp_path: Path) -> None:
    (tmp_path / "results.json").write_bytes((run.folder / "results.json").read_bytes())
    loaded = granpinn.load(tmp_path)
    assert isinstance(loaded, Result)
    with pytest.raises(NetworkFileError, match=f"{FILE}: there is no such file"):
        loaded.predict(0, 0, 0)
    with pytest.raises(FieldsFileError, match=r"fields.h5 does not exist"):
        _ = loaded.fields
    with pytest.raises(HistoryFileError, match=r"history.csv does not exist"):
        loaded.plot.history()
    assert loaded.plot.law().get_xscale() == "log"


# ---- network.safetensors


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
        ({"format_version": 2}, "expected version 1"),
        ({"law": "tresca"}, "the law tresca is not known"),
        ({"widths": [3, 4, 5]}, "do not fit"),
        ({"widths": ["3"]}, "widths"),
        ({"form": "weak"}, "weak"),
        ({"constants": ["grain_diameter"]}, "another version"),
        ({"scales": {"length": 1.0}}, "missing"),
        ({"origin": [0.0]}, "origin"),
        ({"nothing": 1}, "nothing is not known"),
        ({"params": torch.full((157,), torch.nan)}, "do not fit|NaN"),
        ({"theta": torch.zeros(3, dtype=torch.int64)}, "must be float32 or float64"),
        ({"input_shift": torch.zeros(2, dtype=torch.float64)}, "do not fit"),
        ({"physics": torch.zeros(())}, "not iterable"),
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


@pytest.mark.parametrize("cut", [0, 4, 100, -1])
def test_a_cut_network_file_is_refused(run: Run, tmp_path: Path, cut: int) -> None:
    (tmp_path / FILE).write_bytes((run.folder / FILE).read_bytes()[:cut])
    with pytest.raises(NetworkFileError, match=FILE):
        read_network(tmp_path / FILE)


# ---- figures


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


def test_the_first_look_has_law_speed_and_pressure(run: Run) -> None:
    law, speed, pressure = run.result.plot()
    assert law.get_ylabel() == r"$\mu(I)$"
    bars = [ax.get_ylabel() for ax in law.figure.axes[3:]]
    assert bars == ["$|v|$ [m/s]", "$p$ [units of the file]"]
    assert speed.get_title() == pressure.get_title() == f"$t$ = {run.flow.t[7]:.4g}"
    assert len(pyplot.get_fignums()) == 1


def test_a_field_is_shown_at_the_nearest_time_that_has_it(run: Run) -> None:
    first, second = run.result.fields.p_simulated.dropna("t", how="all").t.values
    assert first < run.flow.t[8] < second
    (ax,) = run.result.plot.fields(first - 0.1, ["p_simulated"])
    assert ax.get_title() == f"$t$ = {first:.4g}"


def test_every_figure_can_be_drawn(run: Run) -> None:
    plot = run.result.plot
    values, loss = plot.history()
    assert [line.get_label() for line in values.lines][:1] == [r"$\mu_s$"]
    assert loss.get_yscale() == "log"
    assert plot.residual(0.5).get_title().startswith("$t$ = ")


def test_impossible_figures_are_refused(run: Run) -> None:
    with pytest.raises(BadInput, match="names must be among speed, u, v, p.*got 'q'"):
        run.result.plot.fields(names=["q"])
    with pytest.raises(BadInput, match="axes must be 2 axes of matplotlib, got 1"):
        run.result.plot.fields(axes=[Figure().subplots()])
    with pytest.raises(BadInput, match="ax must be a Axes or None, got str"):
        run.result.plot.law(ax="here")  # type: ignore[arg-type]


# ---- packages


def test_identifying_loads_neither_matplotlib_nor_xarray() -> None:
    code = "import granpinn, sys; granpinn.identify, granpinn.load; "
    code += "print('matplotlib' in sys.modules, 'xarray' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["False", "False"]
