"""The mean strain rate of the last-layer step goes where the data contradict it."""

from __future__ import annotations

import dataclasses
import time

import pytest

from granpinn.data import Flow
from granpinn.fit.case import members, pose
from granpinn.identification.start import start
from granpinn.kernels.builds import choose_device
from granpinn.kernels.network import initial_parameters
from granpinn.physics.laws import DEFAULT
from granpinn.progress import Progress
from granpinn.training import last_layer
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer import FEWER, mean_length
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.objective import Member
from tests.runs import tiny
from tests.training.test_last_layer import PHYSICS, SPEC, THETA, draw, problem

LENGTH = 0.3


def test_the_losses_of_the_trained_network_decide(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It goes if its loss is more than so many times that of the law of points."""
    posed = dataclasses.replace(problem(1e-9, 1e-9, 1e-9, 1e-9, 1), mean_length=LENGTH)
    law = PHYSICS._replace(grain_diameter=1e-3)  # small I: ill-posed
    params, data = initial_parameters(SPEC, seed), draw(seed)
    member = Member(dataclasses.replace(posed, physics=law), data, seed, DEFAULT, {})
    features = Features(SPEC, params)
    points = choose(data, features, seed, 7, FEWER)
    at = Unknowns(coefficients(SPEC, params), THETA)
    mean, local = (
        Sums(features, dataclasses.replace(member.problem, mean_length=length), DEFAULT, points)
        for length in (LENGTH, 0.0)
    )
    ratio = mean.loss(at) / local.loss(at)
    assert abs(ratio - 1) > 1e-3
    for factor, length in ((1.0001 * ratio, LENGTH), (0.9999 * ratio, 0.0)):
        monkeypatch.setattr(last_layer, "CONTRADICTED", factor)
        assert mean_length(member, params, THETA, 7) == length


@pytest.mark.parametrize("factor", [0.0, 1e9])
def test_what_follows_the_step_has_its_length(
    flow: Flow, factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A comparison of laws has the equations of the last layer."""
    monkeypatch.setattr(last_layer, "CONTRADICTED", factor)
    config = tiny(steps=60)
    cases, device = members(pose(flow, config)), choose_device("cpu")
    run = start(cases, config, None, Progress(), time.monotonic(), device)
    run.train()
    ended = run.trainer.ended(0)
    assert ended is not None
    assert (ended[0].problem.mean_length > 0) == (factor > 0)
