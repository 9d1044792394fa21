"""Several flows with one law: one result, from simulated collapses of one material."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn import Identification, identify, load, results, simulate
from granpinn.command import training_run
from granpinn.commands.train import parse
from granpinn.config import ConfigError
from granpinn.data import Flow, write_flow
from granpinn.errors import BadInput
from granpinn.fit import one_law
from granpinn.fit.case import pose
from granpinn.training.objective import Member
from granpinn.training.trainer import Trainer
from granpinn.uncertainty import error_bars, sensitivity
from granpinn.uncertainty.error_model import Known
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
    config = tiny(members=2, checks="quick")
    found = identify(collapses, config, one_law=True, run_dir=tmp_path / "run")
    first, second = found.each
    assert first.parameters == second.parameters == found.parameters
    assert first.members == second.members
    assert found.members is not None
    assert len(set(found.members.values["mu_s"])) == 2  # another law for each network
    assert [flow.I_range for flow in found.flows] == [first.law.I_range, second.law.I_range]
    assert found.law.I_range == (
        min(one.law.I_range[0] for one in found.each if one.law.I_range),
        max(one.law.I_range[1] for one in found.each if one.law.I_range),
    )
    assert found.data.n_points == first.data.n_points + second.data.n_points
    assert found.truth == collapses[0].truth
    assert "momentum_balance" in first.checks
    assert found.checks == {}
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
    assert [one.parameters for one in back.each] == [found.parameters] * 2
    assert json.loads((tmp_path / "run" / "results.json").read_text())["flows"][1]["I_range"]
    again = identify(collapses, config, one_law=True, run_dir=tmp_path / "run", resume=True)
    assert again.parameters == found.parameters


def test_error_bars_are_those_of_all_flows(flow: Flow) -> None:
    config = tiny(checks="quick")
    found = identify([flow, OTHER], config, one_law=True)
    assert found.error_bars is not None
    assert found.covariance is not None
    names = [assumed.name for assumed in found.assumptions]
    assert names == ["surface line of in memory"] * 2
    for one in found.each:
        assert one.covariance == found.covariance
        assert one.law.curve is not None
        assert one.law.curve.low is not None


def test_an_assumption_of_one_flow_moves_the_law_of_all(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Copies with another surface line of one flow train on with the other flow as it is."""
    copies: list[tuple[int, Member]] = []
    train_on = sensitivity.continued

    def continued(trainer: Trainer, asked: list[tuple[int, Member]], most: int) -> Any:
        copies.extend(asked)
        return train_on(trainer, asked, most)

    monkeypatch.setattr(sensitivity, "continued", continued)
    found = identify([flow, OTHER], tiny(checks="quick"), one_law=True)
    assert [e for e, _ in copies] == [0, 1, 0, 1, 1, 0, 1, 0]
    groups = [member.group for _, member in copies]
    assert [groups.count(group) for group in sorted(set(groups))] == [2] * 4
    assert copies[1][1].data is copies[3][1].data  # as it is
    assert copies[0][1].data is not copies[2][1].data  # a line one sd lower and higher
    assert all(assumed.derivative is not None for assumed in found.assumptions)


@pytest.mark.parametrize(
    ("sd", "noise", "free", "words"),
    [
        (0.05, 0.0, True, "I0 is identified: the expected error"),
        (0.2, 0.0, False, "I0 is held at 0.3: the expected error"),
        (0.05, 0.05, False, "I0 is held at 0.3: the noise of a flow is 5 % of its speed"),
    ],
)
def test_I0_is_free_where_ranges_determine_it_and_noise_is_small(
    sd: float, noise: float, free: bool, words: str, flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = Known((0.1, 0.5), (0.4, 0.6), noise=noise, I0=0.3)
    monkeypatch.setattr(one_law, "expected_of", lambda *arguments: known)
    monkeypatch.setattr(one_law, "sd_of", lambda *arguments: {"I0": sd})
    cases, said = one_law.with_free_I0([pose(flow, tiny()) for _ in range(2)])
    assert [("I0" in case.member.law.free) for case in cases] == [free] * 2
    assert said is not None
    assert said.startswith(words)
    given = [pose(flow, tiny(I0=0.25)) for _ in range(2)]
    assert one_law.with_free_I0(given) == (given, None)


def test_the_command_writes_one_result_and_a_page(
    flow: Flow, tmp_path: Path, capsys: pytest.CaptureFixture[str], figures: Callable[..., None]
) -> None:
    figures()
    names = ["heap.h5", "other.h5"]
    paths = [str(tmp_path / name) for name in names]
    for one, path in zip((flow, OTHER), paths, strict=True):
        write_flow(one, Path(path))
    folder = tmp_path / "run"
    config = parse([*paths, "--one-law", "--out", str(folder), "--checks", "none"]).config
    assert (config.flow, config.further_flows) == (paths[0], (paths[1],))
    sizes = {name: getattr(tiny(), name) for name in ("steps", "log_every", "network", "batch")}
    assert training_run.run(dataclasses.replace(config, **sizes)) == 0
    answer = capsys.readouterr().out
    found = results.read_results(folder / "results.json")
    assert [one.input.name for one in found.flows] == names
    assert found.input.name == "heap.h5, other.h5"
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "One law, several flows" in page
    assert "friction_law" in {path.stem for path in (folder / "figures").iterdir()}
    for k, name in enumerate(names):
        assert f"flow    {name}: I = " in answer
        assert name in page
        assert (folder / f"{k:03d}" / "report.html").exists()
    assert str(tmp_path) not in page
    resumed = parse(["--out", str(folder), "--resume"]).config
    assert resumed.further_flows == (paths[1],)


@pytest.mark.parametrize(
    "refused",
    [{"compare_laws": True}, {"free_I0": True}, {"calibrate": True}],
    ids=lambda settings: next(iter(settings)),
)
def test_checks_of_one_flow_are_refused(refused: dict[str, bool], flow: Flow) -> None:
    with pytest.raises(ConfigError, match="is a check of one flow"):
        identify([flow, OTHER], tiny(**refused), one_law=True)


def test_a_flow_that_determines_nothing_is_refused(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "granpinn.identification.one_law.undetermined", lambda seen, level: "walls all around"
    )
    with pytest.raises(ConfigError, match="walls all around; leave this flow out"):
        identify([flow, OTHER], tiny(), one_law=True)


def test_a_check_trains_the_flows_apart(flow: Flow) -> None:
    found: Identification = identify([flow, OTHER], tiny(checks="shared_law"), one_law=True)
    assert found.not_done == {}
    check = found.checks["shared_law"]
    alone = identify(OTHER, tiny(checks="none"))
    assert [law.name for law in check.flows] == ["in memory"] * 2
    mu = alone.friction_law.friction(np.array(check.flows[1].I), *alone.theta)
    np.testing.assert_allclose(check.flows[1].mu, mu, rtol=1e-6)
    assert check.words in found.summary()
