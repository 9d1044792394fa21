"""Copies of a finished network that train on with other data."""

from __future__ import annotations

import dataclasses

import pytest
import torch

from granpinn.config import Config
from granpinn.training.objective import Member
from granpinn.training.trainer import Trainer
from granpinn.uncertainty import sensitivity
from granpinn.uncertainty.sensitivity import continued
from tests.flows import make_flow
from tests.runs import make_trainer, tiny


@pytest.fixture(scope="module")
def finished() -> Trainer:
    return trained(tiny())


def trained(config: Config) -> Trainer:
    trainer = make_trainer(config, make_flow())
    while not trainer.finished:
        trainer.advance()
    trainer.solve_last_layer()
    return trainer


def higher(member: Member, offset: float) -> Member:
    shift = torch.tensor([0.0, offset, 0.0])
    data = dataclasses.replace(member.data, surface_points=member.data.surface_points + shift)
    return dataclasses.replace(member, data=data)


def test_copies_with_the_same_data_stay_the_same(finished: Trainer) -> None:
    member = finished.objective.members[0]
    before = {name: t.clone() for name, t in finished.tensors().items()}
    first, second = continued(finished, [(0, member), (0, member)])
    assert first is not None
    assert second is not None
    assert torch.equal(first, second)
    assert not torch.equal(first, finished.solution(0)[1])
    assert all(torch.equal(before[name], t) for name, t in finished.tensors().items())


def test_copies_follow_their_data() -> None:
    """Differences are those of the data: opposite shifts move the law to opposite sides."""
    exact = trained(tiny(dtype="float64"))  # eight steps change the law by 1e-7
    member = exact.objective.members[0]
    found = continued(exact, [(0, higher(member, a)) for a in (-0.003, 0.0, 0.003)])
    low, middle, high = (t for t in found if t is not None)
    assert not torch.equal(low, high)
    assert bool((((high - middle) * (middle - low))[:2] > 0).all())


def test_a_copy_that_diverges_has_no_law(finished: Trainer) -> None:
    member = finished.objective.members[0]
    velocity = torch.full_like(member.data.velocity, 1e30)
    bad = dataclasses.replace(member, data=dataclasses.replace(member.data, velocity=velocity))
    lost, kept = continued(finished, [(0, bad), (0, member)])
    assert lost is None
    assert kept is not None
    alone = continued(finished, [(0, bad)])
    assert alone == [None]


@pytest.mark.parametrize(("most", "expected"), [(3, 3), (10**6, 8)])
def test_steps(
    finished: Trainer, monkeypatch: pytest.MonkeyPatch, most: int, expected: int
) -> None:
    made = []

    class Counting(Trainer):
        def advance(self) -> None:
            super().advance()
            made.append(self.step)

    monkeypatch.setattr(sensitivity, "Trainer", Counting)
    continued(finished, [(0, finished.objective.members[0])], most)
    assert made == list(range(1, expected + 1))
