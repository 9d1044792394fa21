"""Gate T-5: a NaN or an infinity is noticed in its step, never saved, and stops the run by name."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn.data import Flow
from granpinn.training import checkpoint
from granpinn.training.control_table import ControlTable
from granpinn.training.guard import NonFiniteError
from granpinn.training.loop import TrainingLoop
from granpinn.training.objective import Evaluation
from granpinn.training.progress import Silent
from tests.runs import make_objective, make_run, make_trainer, tiny

BAD = [math.nan, math.inf, -math.inf]
BAD_STEP = 23  # counts from 0; rows and snapshots are at 20 and 25


def poison(run: TrainingLoop, target: str, value: float, times: int) -> list[int]:
    """Put `value` into a tensor of step BAD_STEP, `times` times; the steps where that happened."""
    objective, trainer = run.trainer.objective, run.trainer
    real = objective.evaluate
    poisoned: list[int] = []

    def evaluate(
        control: ControlTable, params: torch.Tensor, theta: torch.Tensor, prefit: bool
    ) -> Evaluation:
        e = real(control, params, theta, prefit)
        if int(control.counter[0]) != BAD_STEP or len(poisoned) == times:
            return e
        poisoned.append(trainer.step)
        if target == "loss":
            return replace(e, loss=e.loss + value)
        if target == "parameter":
            params[0, 3] = value
        elif target == "scalar":
            trainer.law_variables.q[0, 1] = value
        else:
            tensor = getattr(e, target)
            tensor[0, 1] = value
        return e

    objective.evaluate = evaluate  # type: ignore[method-assign]
    return poisoned


NAMES = {
    "loss": "loss",
    "grad_params": "gradient of the network parameters",
    "grad_theta": "gradient of the friction law",
    "parameter": "network parameters",
    "scalar": "variables of the friction law",
}


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("target", NAMES)
def test_it_is_noticed_in_its_step_by_name(target: str, value: float, flow: Flow) -> None:
    run = make_run(tiny(), flow)
    poison(run, target, value, times=1)
    for _ in range(BAD_STEP):
        run.trainer.advance()
    with pytest.raises(NonFiniteError, match=f"the {NAMES[target]} became NaN .* in step 24"):
        run.trainer.advance()
    assert run.trainer.step == BAD_STEP


@pytest.mark.parametrize("target", NAMES)
def test_the_first_time_the_run_goes_back_and_on_more_slowly(
    target: str, flow: Flow, tmp_path: Path
) -> None:
    run = make_run(tiny(), flow, tmp_path / "run")
    poisoned = poison(run, target, math.nan, times=1)
    messages: list[str] = []
    run.progress.message = messages.append  # type: ignore[method-assign]
    run.train()
    assert poisoned == [BAD_STEP]
    assert run.trainer.finished
    assert run.trainer.lr_scale == [0.5]
    assert [row.step for row in run.histories[0].rows] == list(range(5, 41, 5))
    assert len(messages) == 1
    assert NAMES[target] in messages[0]
    assert "back to step 20" in messages[0]
    for tensor in run.trainer.tensors().values():
        assert tensor.isfinite().all()


@pytest.mark.parametrize("target", NAMES)
def test_the_second_time_it_stops_and_a_good_state_is_on_disk(
    target: str, flow: Flow, tmp_path: Path
) -> None:
    run = make_run(tiny(checkpoint_every=0.0), flow, tmp_path / "run")
    poison(run, target, math.nan, times=2)
    with pytest.raises(NonFiniteError, match=f"the {NAMES[target]} .* again, after a rollback"):
        run.train()
    found = checkpoint.newest(tmp_path / "run" / "checkpoint")
    assert found is not None
    assert found.state.training.step == BAD_STEP
    for tensor in found.tensors.values():
        assert tensor.isfinite().all()


def test_the_rollback_uses_half_the_learning_rate_from_the_snapshot_on(flow: Flow) -> None:
    run = make_run(tiny(), flow)
    poison(run, "loss", math.nan, times=1)
    run.train()
    twin = make_trainer(tiny(), flow)
    for step in range(40):
        if step == 20:
            twin.lr_scale = [0.5]
        twin.advance()
    assert torch.equal(run.trainer.params, twin.params)


STATE = ("optimizer.first", "optimizer.second", "optimizer.q.first", "optimizer.q.second")
STATE += ("average.params", "average.q")


@pytest.mark.parametrize("name", STATE)
@pytest.mark.parametrize(("times", "value"), [(1, math.nan), (1, -math.inf), (2, math.inf)])
def test_a_bad_state_of_the_optimizer_is_never_kept(
    times: int, name: str, value: float, flow: Flow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A part that a step uses is noticed in it, and the rest before the state is copied."""
    run = make_run(tiny(checkpoint_every=0.0), flow, tmp_path)
    real, poisoned, messages = run.trainer.advance, list[int](), list[str]()

    def advance() -> None:
        if run.trainer.step == BAD_STEP and len(poisoned) < times:
            poisoned.append(BAD_STEP)
            run.trainer.tensors()[name][0, -1] = value
        real()

    monkeypatch.setattr(run.trainer, "advance", advance)
    monkeypatch.setattr(run.progress, "message", messages.append)
    if times == 1:
        run.train()
        assert "back to step 20" in messages[0]
        assert run.trainer.lr_scale == [0.5]
    else:
        with pytest.raises(NonFiniteError, match=r"again, after a rollback"):
            run.train()
    found = checkpoint.newest(tmp_path / "checkpoint")
    assert found is not None
    assert found.state.training.step == (40 if times == 1 else BAD_STEP)
    for tensor in (*found.tensors.values(), *run.trainer.tensors().values()):
        assert times == 2 or tensor.isfinite().all()


@pytest.mark.parametrize("name", ["points", "velocity", "point_weights", "surface_points"])
def test_data_that_turn_bad_on_the_way_stop_the_run(name: str, flow: Flow, tmp_path: Path) -> None:
    run = make_run(tiny(), flow, tmp_path)
    real = run.trainer.advance

    def advance() -> None:
        if run.trainer.step == 3:
            getattr(run.trainer.objective.pool, name).fill_(math.nan)
        real()

    run.trainer.advance = advance  # type: ignore[method-assign]
    with pytest.raises(NonFiniteError, match="became NaN .* again, after a rollback"):
        run.train()
    found = checkpoint.newest(tmp_path / "checkpoint")
    assert found is not None
    assert all(tensor.isfinite().all() for tensor in found.tensors.values())


@pytest.mark.parametrize("name", ["points", "velocity", "point_weights", "surface_points"])
def test_bad_data_is_refused_before_the_first_step(name: str, flow: Flow) -> None:
    objective: Any = make_objective(tiny(), flow)
    getattr(objective.pool, name)[1, 0] = math.nan
    with pytest.raises(NonFiniteError, match="of the training set hold 1 value"):
        TrainingLoop(objective, tiny(), None, Silent())
