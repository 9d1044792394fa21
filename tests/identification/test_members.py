"""One identification with several networks: their seeds, data, folder, and the result."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from granpinn import identify, identify_many, load, results
from granpinn.config import ConfigError
from granpinn.data import Flow
from granpinn.fit.case import member_seed, pose
from granpinn.fit.ensemble import measured_noise
from granpinn.training.guard import NonFiniteError
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty import error_bars
from tests.identification.test_ensemble import spoil
from tests.runs import tiny

THREE = tiny(members=3, seed=4)


@pytest.fixture
def all_settings_tested(monkeypatch: pytest.MonkeyPatch) -> None:
    """The networks of these tests are not those of the error model."""
    monkeypatch.setattr(error_bars, "untested", lambda config: [])


def test_seeds_are_a_function_of_the_first_and_never_meet() -> None:
    seeds = [member_seed(seed, k) for seed in range(200) for k in range(16)]
    assert len(set(seeds)) == len(seeds)
    assert member_seed(7, 0) == 7
    assert all(0 <= seed < 2**63 for seed in seeds)
    assert member_seed(4, 1) == 2320338089964231254  # on every machine


@pytest.mark.usefixtures("all_settings_tested")
def test_the_result_is_the_center_of_the_members(flow: Flow, tmp_path: Path) -> None:
    found = identify(flow, THREE, run_dir=tmp_path)
    alone = [
        identify(flow, dataclasses.replace(THREE, members=1, seed=member_seed(4, k)))
        for k in range(3)
    ]
    assert found.members is not None
    assert found.members.values["mu_s"] == tuple(one.parameters.mu_s.value for one in alone)
    mu_s = np.array(found.members.values["mu_s"])
    slope = np.array(found.members.values["mu_2"]) - mu_s
    assert found.parameters.mu_s.value == pytest.approx(np.median(mu_s))
    assert found.parameters.mu_2.value == pytest.approx(np.median(mu_s) + np.median(slope))
    shown = alone[found.members.shown]
    assert found.residuals == shown.residuals
    assert found.error_percent.velocity == shown.error_percent.velocity
    assert found.covariance is not None
    for name, variance in zip(("mu_s", "mu_2"), np.diag(found.covariance.matrix), strict=True):
        parameter = getattr(found.parameters, name)
        interval = parameter.interval_90
        if parameter.determined:  # the heap of this test shears at few inertial numbers
            assert parameter.std == pytest.approx(math.sqrt(variance))
        assert interval[0] < parameter.value < interval[1]
    back = results.read_results(tmp_path / "results.json")
    for name in ("parameters", "covariance", "members", "residuals", "error_bars", "assessment"):
        assert getattr(back, name) == getattr(found, name)


@pytest.mark.usefixtures("all_settings_tested")
def test_its_folder_is_that_of_a_run_and_has_a_report(
    flow: Flow, tmp_path: Path, figures: Callable[..., None]
) -> None:
    figures()
    folder = tmp_path / "run"
    found = identify(flow, dataclasses.replace(THREE, members=2), run_dir=folder)
    assert found.members is not None
    shown = identify(flow, dataclasses.replace(THREE, members=2)).history  # in memory
    for name in shown.keys() - {"wall_s"}:
        np.testing.assert_array_equal(found.history[name], shown[name])
    page = load(folder).report().read_text(encoding="utf-8")
    assert "2 networks with different seeds" in page
    assert f"<b>{found.assessment.headline.capitalize()}.</b>" in page
    why = found.parameters.mu_s.undetermined  # three steps determine nothing
    assert why in page
    assert why in found.summary()
    with pytest.raises(ConfigError, match="resume"):
        identify(flow, dataclasses.replace(THREE, members=2), run_dir=folder)


def test_a_member_that_diverged_is_left_out(flow: Flow, monkeypatch: pytest.MonkeyPatch) -> None:
    real = TrainingLoop.train

    def train(run: TrainingLoop) -> None:
        spoil(run, 0, {23, 27})
        real(run)

    monkeypatch.setattr(TrainingLoop, "train", train)
    found = identify(flow, THREE)
    assert found.members is not None
    assert found.members.diverged == 1
    assert found.members.seed == (member_seed(4, 1), member_seed(4, 2))
    assert (found.failure, found.stopped) == (None, "steps")


def test_an_ensemble_without_a_sound_member_is_an_error(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = TrainingLoop.train

    def train(run: TrainingLoop) -> None:
        for member in range(2):
            spoil(run, member, {23, 27})
        real(run)

    monkeypatch.setattr(TrainingLoop, "train", train)
    config = dataclasses.replace(THREE, members=2)
    with pytest.raises(NonFiniteError, match="the loss became NaN"):
        identify(flow, config)
    (found,) = identify_many([flow], config)
    assert found.stopped == "diverged"
    assert found.parameters.mu_s.std is None
    assert found.assessment.reasons[0].startswith("The training diverged")


def test_other_settings_than_the_default_have_no_error_bars(flow: Flow) -> None:
    found = identify(flow, tiny(level="V0", steps=3))
    assert (found.covariance, found.error_bars) == (None, None)
    assert found.law.reason is not None
    for name in ("network.widths", "batch.interior"):
        assert name in found.law.reason


def test_residuals_are_those_of_the_fit(flow: Flow) -> None:
    """Against the error of the velocity in the file: the same points, but for t = 0 and draws."""
    noisy = identify(flow, tiny(noise=0.3, steps=200, weights__follow_noise=False))
    clean = identify(flow, tiny(steps=200))
    assert clean.residuals is not None
    assert clean.residuals.noise == 0
    assert clean.error_percent.velocity is not None
    assert 100 * clean.residuals.velocity == pytest.approx(clean.error_percent.velocity, rel=0.05)
    assert noisy.residuals is not None
    seen = noisy.residuals
    assert seen.noise == pytest.approx(seen.velocity, rel=0.25)
    assert measured_noise(pose(flow, tiny(noise=0.3))) == pytest.approx(seen.noise, rel=0.15)
