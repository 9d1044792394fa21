"""The mean strain rate of the last-layer step goes where the data contradict it."""

from __future__ import annotations

import dataclasses

import pytest

from granpinn import identify
from granpinn.data import Flow
from granpinn.kernels.network import initial_parameters
from granpinn.physics.laws import DEFAULT
from granpinn.training import mean_rate
from granpinn.training.features import Features, coefficients
from granpinn.training.last_layer_sums import Sums, Unknowns, choose
from granpinn.training.mean_rate import FEWER, mean_length
from granpinn.training.objective import Member
from granpinn.training.trainer import Trainer
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
        monkeypatch.setattr(mean_rate, "CONTRADICTED", factor)
        assert mean_length(member, params, THETA, 7) == length


@pytest.mark.parametrize("factor", [0.0, 1e9])
def test_what_follows_the_step_has_its_length(
    flow: Flow, factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The halves of the data and the error bars are those of the same equations."""
    seen: list[Member] = []
    ended = Trainer.ended

    def kept(self: Trainer, place: int) -> object:
        found = ended(self, place)
        assert found is not None
        seen.append(found[0])
        return found

    monkeypatch.setattr(mean_rate, "CONTRADICTED", factor)
    monkeypatch.setattr(Trainer, "ended", kept)
    identify(flow, tiny(steps=60))
    assert seen
    assert {member.problem.mean_length > 0 for member in seen} == {factor > 0}
