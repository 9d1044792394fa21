"""Several flows with one law: one result, from simulated collapses of one material."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import granpinn
from granpinn import identify, identify_many, load, results, simulate
from granpinn.commands.shared import training_run
from granpinn.commands.train import parse
from granpinn.config import ConfigError
from granpinn.data import Flow, write_flow
from granpinn.errors import BadInput
from granpinn.uncertainty import error_bars
from tests.flows import make_flow
from tests.runs import tiny

OTHER = make_flow(frames=9, columns=16, grain_diameter=0.04)


@pytest.fixture(autouse=True)
def all_settings_tested(monkeypatch: pytest.MonkeyPatch) -> None:
    """The networks of these tests are not those of the error model."""
    monkeypatch.setattr(error_bars, "untested", lambda config: [])
    monkeypatch.setattr("granpinn.training.last_layer.LONGEST", 3)


@pytest.fixture(scope="module")
def collapses() -> list[Flow]:
    """Two collapses of one material, of a wide and a slender column."""
    return [simulate(cells=32, frames=10, aspect=aspect, threads=1) for aspect in (2.0, 6.0)]


def test_two_collapses_have_one_law(collapses: list[Flow], tmp_path: Path) -> None:
    config = tiny(members=2, checks="momentum_balance")
    found = identify(collapses, config, one_law=True, run_dir=tmp_path / "run")
    first, second = found.each
    assert first.parameters == identify(collapses[0], config).parameters  # trained by itself
    assert [flow.I_range for flow in found.flows] == [first.law.I_range, second.law.I_range]
    assert found.law.I_range == (
        min(one.law.I_range[0] for one in found.each if one.law.I_range),
        max(one.law.I_range[1] for one in found.each if one.law.I_range),
    )
    assert found.data.n_points == first.data.n_points + second.data.n_points
    assert found.truth == collapses[0].truth
    assert found.error_bars is not None
    assert found.error_bars.scatter is not None
    assert found.law.curve is not None
    assert found.law.curve.low is not None
    assert "momentum_balance" in first.checks
    assert list(found.checks) == ["shared_law"]
    assert found.checks["shared_law"].words in found.summary()
    for flow in found.flows:
        assert str(flow) in str(found)
        assert str(flow) in found.summary()
    with pytest.raises(BadInput, match=r"result\.each"):
        found.network  # noqa: B018
    assert np.isfinite(first.grid.values["p"]).all()
    back = load(tmp_path / "run")
    for field in dataclasses.fields(results.Result):
        if field.name != "settings":  # tuples are lists in JSON
            assert getattr(back, field.name) == getattr(found, field.name), field.name
    assert granpinn.one_law(back.each).parameters == found.parameters
    assert json.loads((tmp_path / "run" / "results.json").read_text())["flows"][1]["I_range"]
    again = identify(collapses, config, one_law=True, run_dir=tmp_path / "run", resume=True)
    assert again.parameters == found.parameters


def test_the_law_can_be_made_later(flow: Flow) -> None:
    flows, config = [flow, OTHER], tiny(checks="momentum_balance")
    found = identify(flows, config, one_law=True)
    names = [assumed.name for assumed in found.assumptions]
    assert names == ["surface line of in memory"] * 2
    assert found.error_bars is not None
    assert found.error_bars.assumptions is not None
    later = granpinn.one_law(identify_many(flows, config))
    assert later.parameters == found.parameters
    assert later.checks == found.checks


def test_the_command_writes_one_result_and_a_page(
    flow: Flow, tmp_path: Path, capsys: pytest.CaptureFixture[str], figures: Callable[..., None]
) -> None:
    figures()
    names = ["heap.h5", "other.h5"]
    paths = [str(tmp_path / name) for name in names]
    for one, path in zip((flow, OTHER), paths, strict=True):
        write_flow(one, Path(path))
    folder = tmp_path / "run"
    config = parse([*paths, "--one-law", "--out", str(folder)])[0]
    assert (config.flow, config.further_flows) == (paths[0], (paths[1],))
    sizes = {name: getattr(tiny(), name) for name in ("steps", "log_every", "network", "batch")}
    assert training_run.run(dataclasses.replace(config, **sizes)) == 0
    answer = capsys.readouterr().out
    found = results.read_results(folder / "results.json")
    assert [one.input.name for one in found.flows] == names
    assert found.input.name == "heap.h5, other.h5"
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "One law, several flows" in page
    assert "Do the flows have one law?" in page
    assert "friction_law" in {path.stem for path in (folder / "figures").iterdir()}
    for k, name in enumerate(names):
        assert f"flow    {name}: I = " in answer
        assert name in page
        assert (folder / f"{k:03d}" / "report.html").exists()
    assert str(tmp_path) not in page
    resumed = parse(["--out", str(folder), "--resume"])[0]
    assert resumed.further_flows == (paths[1],)


def test_another_law_is_refused(flow: Flow) -> None:
    with pytest.raises(ConfigError, match="one law of several flows is mu"):
        identify([flow, OTHER], tiny(law="coulomb"), one_law=True)


def test_fits_without_error_bars_have_a_law_without_them(flow: Flow) -> None:
    found = identify([flow, OTHER], tiny(checks="none"), one_law=True)
    assert found.error_bars is None
    assert found.covariance is None
    assert found.law.curve is not None
    assert found.law.curve.low is None
    assert found.law.reason == f"in memory: {found.each[0].law.reason}"
    assert "there are no error bars" in found.not_done["shared_law"]
    assert "its effect is not known" in str(found.assumptions[0])
