"""The profile of I0: excluded values, the answer, and the profile in a run."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from granpinn import reference, results
from granpinn.checks.profile_of_I0 import Profile, profile_from
from granpinn.commands import train
from granpinn.data import Flow
from granpinn.fit.case import pose
from granpinn.fit.ensemble import final_loss
from granpinn.identification.start import start
from granpinn.physics.terms import NAMES as TERMS
from granpinn.results import InertialNumber, Parameter, Parameters, Result
from granpinn.results.records import Loss
from granpinn.training.parallel import processes
from tests.data.walled import FLOOR
from tests.examples import make_result
from tests.runs import tiny

GRID = [0.1, 0.2, 0.3, 0.4, 0.8]


SEEDS = (0, 1, 2)


SCATTER = 1e-6


BAND = InertialNumber(q05=0.0, median=0.03, q95=0.09)


def member(I0: float, seed: int, loss: float, mu_2: float) -> Result:
    parameters = Parameters(
        mu_s=Parameter(0.4, False), mu_2=Parameter(mu_2, False), I0=Parameter(I0, True)
    )
    # What a seed does to all its losses must drop out.
    draw = np.random.default_rng([round(1000 * I0), seed]).normal()
    scatter = 0.5 * seed + SCATTER * draw
    terms = {"velocity": loss + scatter, "momentum": 0.0}
    weights = {"velocity": 1.0, "momentum": 10.0}
    return make_result(
        parameters=parameters,
        seed=seed,
        failure=None,
        inertial_number=BAND,
        loss=Loss(100, terms, weights),
    )


def profile_of(
    loss: Callable[[float], float], mu_2: Callable[[float], float] = lambda I0: 0.64
) -> Profile:
    members = [member(I0, seed, loss(I0), mu_2(I0)) for I0 in GRID for seed in SEEDS]
    return profile_from(members, law_accuracy=0.005)


def parabola(I0: float) -> float:
    return 0.01 * math.log(I0 / 0.26) ** 2


def test_a_valley_gives_its_bottom() -> None:
    profile = profile_of(parabola)
    assert profile.best == pytest.approx(0.26, rel=1e-2)
    assert profile.answer.startswith("I0 = 0.26")
    low, high = profile.allowed
    assert low is not None
    assert high is not None
    assert low < 0.26 < high
    assert [p.excluded for p in profile.points] == [True, True, False, True, True]


def test_a_flat_loss_gives_no_number() -> None:
    profile = profile_of(lambda I0: 0.0)
    assert profile.best is None
    assert profile.allowed == (None, None)
    assert profile.answer == "I0 is not separable in these data: I covers 0.00..0.09"
    assert not any(p.excluded for p in profile.points)


@pytest.mark.parametrize(("sign", "words"), [(1, "I0 is below"), (-1, "I0 is above")])
def test_a_slope_gives_a_bound(sign: int, words: str) -> None:
    profile = profile_of(lambda I0: 0.01 * max(0.0, sign * math.log(I0 / 0.3)))
    assert profile.answer.startswith(words)
    assert (profile.allowed[0] is None) == (sign > 0)
    assert (profile.allowed[1] is None) == (sign < 0)
    assert profile.best is None


def test_final_loss_is_that_of_all_points_below_the_highest_vectors(flow: Flow) -> None:
    config = tiny(dtype="float64", optimizer__average=0.3)
    run = start(
        [pose(replace(flow, walls=FLOOR), config)],
        config,
        None,
        None,
        time.monotonic(),
        processes("cpu"),
    )
    run.train()
    found = final_loss(run.trainer, 0)
    assert found is not None
    objective = run.trainer.objective
    params, theta = run.trainer.solution(0)
    assert not torch.equal(params, run.trainer.params[0])  # the average
    problem, data = objective.members[0].problem, objective.members[0].data
    places = torch.arange(len(objective.pool.points))  # vectors, points between, strip, walls
    first, walls = len(data.points) + len(data.between), len(places) - len(data.wall_points)
    assert first < walls < len(places)
    held = objective.pool.at(places[(places < first) | (places >= walls)], slice(None))
    terms = reference.loss_terms(params, theta, held, problem.spec, problem.physics)
    assert list(found.terms) == list(TERMS)
    velocity, equations = held.point_weights.mean(0)  # a part of all points
    terms = terms / torch.stack([velocity, torch.ones(()), *[equations] * 3])
    np.testing.assert_allclose(list(found.terms.values()), terms.tolist(), rtol=1e-9)
    assert found.n_points == len(held.points)
    assert found.weights["momentum"] == pytest.approx(0.05**-2)


@pytest.mark.usefixtures("no_report")
def test_the_command_says_it_and_writes_it(
    flow_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = ["--steps", "20", "--log-every", "10", "--network.widths", "6,5"]
    flags += ["--profile.values", "3", "--profile.seeds", "2", "--batch.interior", "16"]
    flags += ["--simulated_pressure.frames", "0"]
    out = tmp_path / "run"
    assert train.main([str(flow_file), "--out", str(out), "--free-I0", *flags]) == 0
    found = results.read_results(out / "results.json")
    profile = found.checks["profile_of_I0"]
    assert [p.I0 for p in profile.points] == pytest.approx([0.075, 0.3, 1.2])
    assert profile.answer in capsys.readouterr().out
    assert found.parameters.I0.fixed
    assert not (out / "profile" / "000" / "fields.h5").exists()
    settings = json.loads((out / "profile" / "000" / "results.json").read_text())["settings"]
    assert settings["optimizer"]["average"] == 0.2
    # Again, from what is there: nothing is trained anew.
    assert train.main(["--out", str(out), "--resume"]) == 0
    assert results.read_results(out / "results.json").checks["profile_of_I0"] == profile
