"""A run with a time limit ends at its limit, annealed, on a clock that the test turns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn.config import Config
from granpinn.data import Flow
from granpinn.errors import Interrupted
from granpinn.progress import Progress
from granpinn.signals import Signals
from granpinn.training import loop as loop_module
from granpinn.training import time_limit
from granpinn.training.loop import TrainingLoop
from granpinn.training.time_limit import Limit
from tests.runs import make_objective, make_trainer, tiny


class Clock:
    """Stands still except during a step, which takes `slow` or `fast` seconds."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.fast, self.slow = 0.1, 0.4
        for module in (time_limit, loop_module):
            monkeypatch.setattr(module.time, "monotonic", lambda: self.now)

    def attach(self, trainer: Any) -> None:
        real = trainer.advance

        def advance() -> None:
            alone = trainer.schedule.in_prefit(trainer.step)
            real()
            self.now += self.fast if alone else self.slow

        trainer.advance = advance


def until(moment: float) -> Limit:
    """The limit of a run that begins with the clock of a test."""
    return Limit(moment, moment - 100.0)


@pytest.fixture
def ticking(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def limited(**changes: Any) -> Config:
    return tiny(**({"steps": None, "max_time": 1000.0, "optimizer__prefit": 0.25} | changes))


def test_the_schedule_fits_the_time_and_leaves_the_state_alone(flow: Flow, ticking: Clock) -> None:
    trainer = make_trainer(tiny(optimizer__prefit=0.25), flow)
    before = {name: tensor.clone() for name, tensor in trainer.tensors().items()}
    state = trainer.plain_state()
    ticking.attach(trainer)
    schedule = time_limit.schedule_within(Limit(400.0, 300.0), trainer, at_most=10**9)
    probing = ticking.now - 100.0
    pace = 0.25 * 0.1 + 0.75 * 0.4
    assert schedule.total == pytest.approx((300 - probing) / pace / time_limit.MARGIN, abs=1)
    assert trainer.plain_state() == state
    for name, tensor in trainer.tensors().items():
        assert torch.equal(tensor, before[name])


@pytest.mark.parametrize(
    ("pace", "kept"),
    [
        pytest.param(0.0, 30.0, id="quick steps"),
        pytest.param(0.032, 50 * 0.032 + 30, id="slow steps"),
        pytest.param(4.0, 120.0, id="at most a part of the limit"),
    ],
)
def test_what_is_kept_for_the_end_grows_with_the_pace(pace: float, kept: float) -> None:
    limit = Limit(1000.0, 200.0, later=10.0, steps=50, after=30.0)
    assert limit.deadline(pace) == pytest.approx(990 - kept)


@pytest.mark.parametrize("factor", [1.0, 0.5, 2.0])
def test_a_run_ends_at_its_limit_though_its_pace_changes(
    factor: float, flow: Flow, ticking: Clock
) -> None:
    run = TrainingLoop(make_objective(limited(), flow), limited(), None, Progress(), until(300.0))
    ticking.attach(run.trainer)
    real = run.trainer.advance

    def advance() -> None:
        if run.trainer.step == 240:
            ticking.slow *= factor
        real()

    run.trainer.advance = advance  # type: ignore[method-assign]
    totals: list[float] = []
    run.progress.at = lambda *at: totals.append(at[2])  # type: ignore[method-assign, assignment]
    run.train()
    assert 0.9 * 200 < ticking.now - 100.0 <= 200
    assert run.stopped == "max_time"
    assert run.trainer.schedule.progress(run.trainer.step) == 1
    rates = [row["learning_rate"] for row in run.histories[0].rows]
    assert rates[-1] < 0.02 * max(rates)
    assert totals[-1] == run.trainer.step


def test_a_resumed_run_keeps_the_schedule(flow: Flow, ticking: Clock, tmp_path: Path) -> None:
    def make(config: Config) -> TrainingLoop:
        run = TrainingLoop(make_objective(config, flow), config, tmp_path, Progress(), until(160.0))
        ticking.attach(run.trainer)
        return run

    run = make(limited())
    loop = run._loop

    def stop_at_once(signals: Signals) -> None:
        signals.handle(2, None)
        loop(signals)

    run._loop = stop_at_once  # type: ignore[method-assign]
    with pytest.raises(Interrupted):
        run.train()
    again = make(replace(limited(), resume=True))
    again.train()
    assert again.trainer.step == run.trainer.schedule.total
    assert again.stopped == "max_time"
