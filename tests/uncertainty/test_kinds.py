"""Error bars of flows that are no collapses, from a stated error of the model."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granpinn.config import Config
from granpinn.data.symmetry import WORDS
from granpinn.identification import judgement
from granpinn.identification.single import identify
from granpinn.physics.laws import mu_of_i
from granpinn.results import Result
from granpinn.results.assumed import Assumed
from granpinn.results.records import Members
from granpinn.results.summary import friction_sd
from granpinn.uncertainty import calibration, of_training
from granpinn.uncertainty.calibration import ModelError
from granpinn.uncertainty.center import center
from granpinn.uncertainty.determined import Range
from granpinn.uncertainty.held import Held, ends_of
from granpinn.uncertainty.of_kind import covariance, kind_of, with_model_error
from granpinn.uncertainty.of_training import judge
from tests.examples import make_result
from tests.flows import make_chute, make_flow
from tests.runs import tiny

ENTRY = ModelError(level=0.03, tilt=0.02, flows=6, provenance="six chutes")
SHEAR = Range(0.01, 0.1, 0.05, {})
I0 = 0.3


def table_with(*kinds: str) -> calibration.Calibration:
    return dataclasses.replace(calibration.load(), model_error=dict.fromkeys(kinds, ENTRY))


def one_network() -> Result:
    """The result of one network after the default number of steps."""
    example = make_result()
    alone = Members((0,), {"mu_s": (0.39,), "mu_2": (0.62,)}, (False,))
    steps = dataclasses.replace(example.timing, steps=40_000)
    return dataclasses.replace(example, members=alone, timing=steps)


def chute_result() -> Result:
    """A result as `judge` leaves it for a steady chute: values without error bars."""
    example = one_network()
    assert example.members is not None
    config = Config()
    words = tuple(WORDS.values())
    judged = judge(example.members, example.residuals, 40_000, config, False, words)
    assert judged.bars is None
    parameters = type(example.parameters)({**dict(example.parameters.items()), **judged.free})
    return dataclasses.replace(
        example,
        parameters=parameters,
        covariance=None,
        error_bars=None,
        verdict=judged.verdict,
        data=dataclasses.replace(example.data, symmetries=words),
    )


@pytest.mark.parametrize(
    ("axes", "carried", "of_solver", "expected"),
    [
        ((), False, True, None),
        ((), False, False, "collapse"),
        ((0,), False, True, "layer"),
        ((0, 2), False, False, "steady_layer"),
        ((2,), False, False, "steady"),
        ((), True, False, "carried"),
        ((2,), True, True, "carried"),
    ],
)
def test_kinds(axes: Any, carried: bool, of_solver: bool, expected: str | None) -> None:
    assert kind_of(tuple(WORDS[axis] for axis in axes), carried, of_solver) == expected


@pytest.mark.parametrize("shear", [SHEAR, Range(0.002, 0.5, 0.1, {})])
def test_the_covariance_gives_the_stated_errors_of_mu(shear: Range) -> None:
    mu = (0.35, 0.7)
    C = covariance(ENTRY, mu, I0, shear)
    x = np.array([shear.low, shear.high]) / (np.array([shear.low, shear.high]) + I0)
    for at in x:
        J = np.array([1 - at, at])
        relative = np.sqrt(J @ C @ J) / (J @ mu)
        assert relative == pytest.approx(np.hypot(0.03, 0.02))
    level = covariance(dataclasses.replace(ENTRY, tilt=0.0), mu, I0, shear)
    np.testing.assert_allclose(level, 0.03**2 * np.outer(mu, mu), rtol=1e-9)


def test_a_random_error_of_mu_has_this_covariance(seed: int) -> None:
    """Draws of level and tilt, and the law through the two ends of the range."""
    mu, rng = np.array([0.35, 0.7]), np.random.default_rng(seed)
    x = np.array([SHEAR.low, SHEAR.high]) / (np.array([SHEAR.low, SHEAR.high]) + I0)
    true = mu[0] * (1 - x) + mu[1] * x
    a, b = rng.normal(0, ENTRY.level, 40_000), rng.normal(0, ENTRY.tilt, 40_000)
    wrong = true * (1 + a[:, None] + b[:, None] * np.array([-1, 1]))
    slope = (wrong[:, 1] - wrong[:, 0]) / (x[1] - x[0])
    mu_s = wrong[:, 0] - slope * x[0]
    found = np.cov(np.stack([mu_s, mu_s + slope]))
    np.testing.assert_allclose(covariance(ENTRY, (0.35, 0.7), I0, SHEAR), found, rtol=0.05)


def test_a_chute_gets_the_error_bars_of_its_kind() -> None:
    result = chute_result()
    found = with_model_error(result, Config(), "steady_layer", SHEAR, table_with("steady_layer"))
    assert found.theta == result.theta
    assert found.covariance is not None
    assert found.error_bars is not None
    assert found.error_bars.provenance == "six chutes"
    at = np.array([SHEAR.low, SHEAR.high])
    sd = friction_sd(at, found, found.covariance)
    mu = mu_of_i.LAW.friction(at, *found.theta)
    assert np.all(sd / mu > np.hypot(0.03, 0.02))
    assert np.all(sd / mu < 0.05)
    assert found.parameters["mu_2"].interval_90 is not None
    assert found.verdict is not None
    assert found.verdict.follows is None
    assert "6 flows of grains that are steady and the same along x, whose mu(I) was 3 %" in str(
        found
    )


def test_one_inertial_number_determines_no_coefficient() -> None:
    """Without a range the tilt is not bounded: mu is known there, mu_s and mu_2 are not."""
    one = Range(0.12, 0.12, 0.12, {})
    found = with_model_error(chute_result(), Config(), "layer", one, table_with("layer"))
    assert found.covariance is not None
    at = friction_sd(np.array([0.12]), found, found.covariance)[0]
    assert at / mu_of_i.LAW.friction(np.array([0.12]), *found.theta)[0] < 0.05
    assert (found.parameters["mu_s"].std or 0) > 10


@pytest.mark.parametrize("kind", ["layer", "steady", "carried", None])
def test_no_data_no_error_bars(kind: str | None) -> None:
    result = chute_result()
    assert with_model_error(result, Config(), kind, SHEAR, table_with("steady_layer")) is result
    assert with_model_error(result, Config(), kind, SHEAR, table_with()) is result


def test_other_settings_have_no_error_bars_either() -> None:
    result, table = chute_result(), table_with("layer")
    assert with_model_error(result, tiny(), "layer", SHEAR, table) is result
    lost = Assumed("surface line", "m", 1.0, None, "one grain higher", why="it diverged")
    unknown = dataclasses.replace(result, assumptions=(lost,))
    assert with_model_error(unknown, Config(), "layer", SHEAR, table) is unknown


def test_grains_that_collapse_keep_the_errors_of_simulated_collapses() -> None:
    example = one_network()
    assert example.members is not None
    held = Held(ends_of((SHEAR.low, SHEAR.high), I0))
    judged = judge(example.members, example.residuals, 40_000, Config(), False, held=held)
    assert judged.covariance is not None
    result = dataclasses.replace(example, covariance=judged.covariance, error_bars=judged.bars)
    mu = center(example.members)
    found = with_model_error(result, Config(), "collapse", SHEAR, table_with("collapse"))
    assert found.covariance is not None
    added = np.array(found.covariance.matrix) - np.array(judged.covariance.matrix)
    np.testing.assert_allclose(added, covariance(ENTRY, (mu[0], mu[1]), I0, SHEAR), rtol=1e-6)
    assert found.verdict == result.verdict


def test_a_training_asks_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def spy(result: Result, config: Config, kind: str | None, shear: Range) -> Result:
        seen.append((kind, shear.low < shear.high))
        return result

    monkeypatch.setattr(judgement.of_kind, "with_model_error", spy)
    identify(make_chute(frames=2), tiny())
    identify(make_flow(), tiny())
    identify(make_flow(attributes={"grid_spacing_of_solver": 0.04}), tiny())
    # twice where the effect of an assumption follows
    assert list(dict.fromkeys(kind for kind, _ in seen)) == ["steady_layer", "collapse", None]


REFUSED = {
    "of an unknown kind": ({"silo": {"level": 0.1}}, "model_error.silo"),
    "above 1": ({"layer": {"level": 3.0}}, "level must be from 0 to 1"),
    "of no flows": ({"layer": {"flows": 0}}, "flows must be at least 1"),
}


@pytest.mark.parametrize(("entries", "words"), REFUSED.values(), ids=REFUSED.keys())
def test_a_wrong_table_is_refused(tmp_path: Path, entries: Any, words: str) -> None:
    whole = {kind: dataclasses.asdict(ENTRY) | own for kind, own in entries.items()}
    content = json.loads(calibration.PATH.read_text()) | {"model_error": whole}
    (tmp_path / "table.json").write_text(json.dumps(content))
    with pytest.raises(ValueError, match=words):
        calibration.load(tmp_path / "table.json")


def test_level_v0_has_error_bars_once_it_has_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    example = make_result()
    assert example.members is not None
    arguments = example.members, example.residuals, 40_000, Config(level="V0"), False
    paths = {**calibration.PATHS, "V0": tmp_path / "V0.json"}
    monkeypatch.setattr(calibration, "PATHS", paths)
    found = judge(*arguments)
    assert found.bars is None
    assert "at level V1 or V2, and this run has another level" in found.verdict.words
    wide = dataclasses.asdict(calibration.load()) | {"provenance": "collapses at level V0"}
    paths["V0"].write_text(json.dumps(wide))
    found = judge(*arguments)
    assert found.bars is not None
    assert found.bars.provenance == "collapses at level V0"
    assert of_training.uncalibrated(Config(level="V0")) == []
