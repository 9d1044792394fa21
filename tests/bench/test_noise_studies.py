"""The studies of noise and of I0: statistics by hand, bounds scaled to the row."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.studies.draws import read_bounds, read_study, statistics, thinned, with_bounds
from bench.studies.inertial_number import run as inertial_study
from bench.studies.noise import gaps
from bench.studies.noise import run as noise_study
from granpinn.config import Config, ConfigError
from granpinn.data import Truth
from granpinn.results import Parameter, Parameters, Result, plain
from granpinn.results.loss import Loss
from tests.examples import make_result
from tests.flows import make_flow

TRUTH = Truth(0.4, 0.64, 0.3)
FLOW = make_flow(frames=6, rows=12, columns=10, truth=TRUTH)
KNOWN = {
    "mu_s": 0.4,
    "mu_2": 0.64,
    "points": 400,
    "noise": 0.1,
    "one_grid": {
        "mu_s_percent": 1.0,
        "mu_2_percent": 2.0,
        "joint_percent": {"mu_s": 1.5, "mu_2": 6.0, "I0": 20.0},
    },
    "two_grids": {"mu_s_percent": 1.1, "mu_2_percent": 2.2},
}
NO_BOUND = {"mu_s_percent": None, "mu_2_percent": None}  # where J has no information


def tiny() -> Config:
    small = {"network__widths": (6, 5), "batch__interior": 16, "batch__surface": 4}
    return Config(steps=20, simulated_pressure__frames=0, device="cpu", **small)


def result(mu_s: float, mu_2: float, I0: float, seed: int, loss: float) -> Result:
    values = (Parameter(mu_s, fixed=False), Parameter(mu_2, fixed=False), Parameter(I0, fixed=True))
    weights = {"velocity": 1.0}
    return make_result(
        parameters=Parameters(zip(("mu_s", "mu_2", "I0"), values, strict=True)),
        seed=seed,
        loss=Loss(9, {"velocity": loss}, weights),
    )


def test_rmse_is_bias_and_scatter() -> None:
    found = statistics([1.0, 3.0, 2.0])
    assert found["rmse"] == pytest.approx(math.sqrt(14 / 3))
    assert (found["bias"], found["sd"]) == pytest.approx((2.0, 1.0))
    assert found["rmse"] ** 2 == pytest.approx(found["bias"] ** 2 + found["sd"] ** 2 * 2 / 3)
    assert math.isnan(statistics([1.0])["rmse"])


def test_the_standard_error_of_the_rmse_is_its_scatter() -> None:
    rng = np.random.default_rng(1)
    draws = [statistics(rng.normal(0.5, 1, 20)) for _ in range(4000)]
    spread = float(np.std([d["rmse"] for d in draws]))
    assert np.mean([d["rmse_error"] for d in draws]) == pytest.approx(spread, rel=0.1)


def test_thinning_keeps_as_many_vectors_and_changes_none() -> None:
    some, again = (thinned(FLOW, 100) for _ in range(2))
    assert some.valid.sum() == 100
    np.testing.assert_array_equal(some.valid, again.valid)
    np.testing.assert_array_equal(some.u[some.valid], FLOW.u[some.valid])
    assert thinned(FLOW, 0) is FLOW
    with pytest.raises(ConfigError, match=f"at most {FLOW.valid.sum()}, the vectors of a flow"):
        thinned(FLOW, 10**6)


def test_the_bound_goes_with_noise_and_points() -> None:
    errors = {name: {"rmse": 3.0} for name in ("mu_s", "mu_2", "I0")}
    row = {"mu_s": 0.4, "mu_2": 0.64, "noise": 0.2, "points": 1600, "errors_percent": errors}
    (found,) = noise_study.with_bounds([row], [KNOWN])
    assert found["bound_percent"]["mu_s"] == pytest.approx({"one_grid": 1.0, "two_grids": 1.1})
    assert found["rmse_over_bound"] == pytest.approx({"mu_s": 3.0, "mu_2": 1.5})
    (found,) = with_bounds([row], [KNOWN])
    assert found["bound_percent"] == pytest.approx({"mu_s": 1.5, "mu_2": 6.0, "I0": 20.0})
    (found,) = noise_study.with_bounds([row | {"mu_2": 0.52}], [KNOWN])
    assert "bound_percent" not in found


def test_draws_are_trained_and_kept_apart() -> None:
    tasks = list(noise_study.tasks_of([FLOW], [0.2, 0.8], [100, 0]))
    assert [(task.noise, task.flow.valid.sum()) for task in tasks] == [
        *((sd, n) for n in (100, FLOW.valid.sum()) for sd in (0.2, 0.8))
    ]
    found = noise_study.study(tasks, tiny(), 2)
    assert [row["points"] for row in found["rows"]] == [100, 100, *[FLOW.valid.sum()] * 2]
    draws = [row["draws_percent"]["mu_s"] for row in found["rows"]]
    assert len({value for pair in draws for value in pair}) == 8  # no two are the same training
    assert "(0.40, 0.64)" in noise_study.text(found["rows"])
    with pytest.raises(ConfigError, match="must have true_mu_s, true_mu_2 and true_I0"):
        list(noise_study.tasks_of([replace(FLOW, truth=None)], [0.2], [0]))


def test_the_estimate_of_I0_is_the_vertex_of_every_draw() -> None:
    grid = [0.15, 0.3, 0.6]
    places = {0: 0.1, 1: -0.2}  # of the minimum in log2(I0/0.3)

    def loss(I0: float, seed: int) -> float:
        return 1 + (math.log2(I0 / 0.3) - places[seed]) ** 2

    results = [result(0.4, 2 * I0, I0, seed, loss(I0, seed)) for seed in places for I0 in grid]
    results += [result(0.4, 0.6, I0, 2, I0) for I0 in grid]  # the least loss at an end
    found = inertial_study.estimates_of(results)
    assert found[2] is None
    for seed, place in places.items():
        draw = found[seed]
        assert draw is not None
        assert draw[2] == pytest.approx(0.3 * 2**place)
        assert 0.3 < draw[1] < 1.2


def test_the_study_of_I0_has_an_answer_and_ratios(tmp_path: Path) -> None:
    config = inertial_study.settings(["--steps", "20", "--batch.interior", "16"], 3, 2.0)
    assert (config.profile.values, config.optimizer.average) == (3, 0.2)
    small = replace(config, network__widths=(6, 5), batch__surface=4, device="cpu")
    found = inertial_study.study([FLOW], small, 0.02, 2)
    (row,) = found["rows"]
    assert (row["draws"], found["trainings"]) == (2, 6)
    assert [point["I0"] for point in row["profile"]["points"]] == pytest.approx([0.15, 0.3, 0.6])
    path = tmp_path / "bound.json"
    path.write_text(json.dumps({"rows": [KNOWN]}))
    text = inertial_study.text(with_bounds([row], read_bounds([path])))
    assert "ratio" in text
    assert row["profile"]["answer"] in text


@pytest.mark.parametrize("names", [noise_study.NAMES, inertial_study.NAMES])
def test_an_earlier_study_without_statistics_is_read_and_shown(
    names: tuple[str, ...], tmp_path: Path
) -> None:
    study = noise_study if names == noise_study.NAMES else inertial_study
    row = {"mu_s": 0.4, "mu_2": 0.64, "noise": 0.2, "points": 400, "draws": 1, "at_an_end": 1}
    row |= {"failed": 0, "median_percent": {"pressure": None}, "profile": {"answer": "none"}}
    row |= {"errors_percent": {name: statistics([]) for name in names}}
    (tmp_path / "study.json").write_text(json.dumps(plain({"rows": [row]}), allow_nan=False))
    (tmp_path / "bound.json").write_text(json.dumps({"rows": [KNOWN | {"two_grids": NO_BOUND}]}))
    rows = read_study(tmp_path / "study.json")["rows"]
    rows = study.with_bounds(rows, read_bounds([tmp_path / "bound.json"]))
    assert math.isnan(rows[0]["rmse_over_bound"]["mu_s"])
    assert "nan" in study.text(rows)


@pytest.mark.parametrize("length", [0.0, 2.0])
def test_added_noise_has_the_stated_size_and_correlation(length: float, seed: int) -> None:
    flow = make_flow(frames=30, rows=40, columns=40)
    speed = np.sqrt(np.mean((flow.u**2 + flow.v**2)[flow.valid]))
    e = (gaps.noisy(flow, 0.1, length, seed).u - flow.u) / speed
    assert np.nanstd(e) == pytest.approx(0.1, rel=0.1)
    neighbors = np.nanmean(e[:, :, 1:] * e[:, :, :-1]) / np.nanvar(e)
    truth = np.exp(-1 / 2 / length**2) if length else 0.0
    assert neighbors == pytest.approx(truth, abs=0.1)


def test_made_up_fields_have_their_noise(seed: int) -> None:
    found = gaps.made_up(2.0, 0.05, "scattered", 0.1, seed)
    assert found["sigma"] == pytest.approx(found["true_sigma"], rel=0.15)
    truth = found["true_vectors_per_independent"]
    # The mean over pairs in a square, less than 2 pi l^2 times the density because of its edges.
    assert 0.8 * (1 + 2 * np.pi * 4 * 0.1) < truth < 1 + 2 * np.pi * 4 * 0.1
    assert found["vectors_per_independent"] == pytest.approx(truth, rel=0.3)
