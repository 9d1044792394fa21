"""Gate T-5: a NaN or an infinity is noticed in its step, never saved, and stops the run by name.

A value is put into the data, the loss, the gradients, the parameters, the law or the state of the
optimiser. It must be noticed in the same step, or (parts that no step reads) before the state is
copied or saved. A GPU makes a stretch of steps before the host looks: there it must be noticed at
the end of its stretch. The first time the run goes back and on, the second time it stops.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import cycle, product
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn.data import Flow
from granpinn.training import checkpoint
from granpinn.training.graphs import Graphs
from granpinn.training.guard import NonFiniteError
from granpinn.training.loop import TrainingLoop
from tests.runs import make_run, make_trainer, tiny
from tests.training.test_graphs import record

BAD_STEP = 23  # counts from 0; rows and snapshots are at 20 and 25, and so are the stretches
DATA = ("points", "velocity", "point_weights", "surface_points", "surface_pressure")
GRADIENTS = {"loss": "loss", "grad_params": "gradient of the network parameters"}
GRADIENTS |= {"grad_theta": "gradient of the friction law"}
# A tensor of the state -> words of which the sentence must have one.
STATE = {
    "params": ("network parameters", "loss", "gradient"),
    "q": ("variables of the friction law", "loss"),
    "optimizer.first": ("parameters", "tensor optimizer.first"),
    "optimizer.second": ("parameters", "tensor optimizer.second"),
    "optimizer.q.first": ("friction law",),
    "optimizer.q.second": ("friction law",),
}
SETTINGS: dict[str, Any] = {"level": "V2", "checkpoint_every": 0.0}


class Spoiled:
    """A run that gets a value in step BAD_STEP, `times` times, and what becomes of it.

    The loss and the gradients exist on the device alone, inside of a captured step. They get the
    value there, in the step itself; all else gets it before its stretch.
    """

    def __init__(self, run: TrainingLoop, name: str, value: float, times: int) -> None:
        trainer, objective = run.trainer, run.trainer.objective
        self.run, self.stretches = run, list[range]()
        self.noticed, self.messages = list[int](), list[str]()
        armed = torch.full_like(trainer.control.counter[0], -1)  # step of the value, on the device
        advance, recover, evaluate = trainer.advance, run._recover, objective.evaluate

        def spoil(tensor: torch.Tensor) -> None:
            flat = tensor.view(-1)
            flat[int(0.4 * len(flat))] = value

        def advanced() -> None:
            stretch = range(trainer.step, trainer.step + trainer._stretch())
            due = BAD_STEP in stretch and len(self.stretches) < times
            armed.fill_(BAD_STEP if due and name in GRADIENTS else -1)
            if due:
                self.stretches.append(stretch)
                if name in STATE:
                    spoil(trainer.tensors()[name])
                elif name in DATA:
                    getattr(objective.pool, name).fill_(value)
            advance()

        def evaluated(*args: Any) -> Any:
            found = evaluate(*args)
            if name not in GRADIENTS:
                return found
            spoilt = getattr(found, name).clone()
            spoil(spoilt)
            now = trainer.control.counter[0] == armed
            return replace(found, **{name: torch.where(now, spoilt, getattr(found, name))})

        def recovered(error: NonFiniteError) -> None:
            # A part that no step reads is found after its stretch.
            self.noticed.append(max(self.stretches[-1][0], trainer.step - 1))
            recover(error)

        patches: dict[str, tuple[Any, Callable[..., Any]]] = {
            "advance": (trainer, advanced),
            "evaluate": (objective, evaluated),
            "_recover": (run, recovered),
            "message": (run.progress, self.messages.append),
        }
        for method, (owner, replacement) in patches.items():
            setattr(owner, method, replacement)


# Each tensor once and twice, one of both in graphs, with each value in turn.
CASES = [
    pytest.param(name, times, graphs, value, id=f"{name}-{times}-{graphs and 'graphs'}-{value}")
    for (k, (name, times)), value in zip(
        enumerate(product((*DATA, *GRADIENTS, *STATE), (1, 2))),
        cycle((math.nan, math.inf, -math.inf)),
        strict=False,
    )
    for graphs in [k % 4 in (0, 3)]
]


@pytest.mark.parametrize(("name", "times", "graphs", "value"), CASES)
def test_a_value_is_noticed_never_saved_and_stops_the_run_by_name(
    name: str, times: int, graphs: bool, value: float, flow: Flow, tmp_path: Path
) -> None:
    run = make_run(tiny(**SETTINGS), flow, tmp_path)
    if graphs:
        run.trainer.graphs = Graphs(run.trainer.one_step, run.trainer.changing(), record)
    spoiled = Spoiled(run, name, value, times)
    words = STATE.get(name) or (GRADIENTS.get(name, "became NaN or infinite"),)
    if times == 1 and name not in DATA:  # data stay bad after a rollback
        run.train()
        assert run.trainer.finished
        assert run.trainer.lr_scale == [0.5]
        assert [row["step"] for row in run.histories[0].rows] == list(range(5, 41, 5))
        (message,) = spoiled.messages
        assert "back to step 20" in message
        step = 40
    else:
        with pytest.raises(NonFiniteError, match=r"became NaN .* again, after a rollback") as error:
            run.train()
        message = str(error.value)
        step = 20 if graphs else BAD_STEP
    assert any(word in message for word in words)
    first, last = (20, 24) if graphs else (BAD_STEP, BAD_STEP)
    assert {stretch[0] for stretch in spoiled.stretches} == {first}
    assert first <= spoiled.noticed[0] <= last
    found = checkpoint.newest(tmp_path / "checkpoint")
    assert found is not None
    assert found.state.training.step <= step
    saved = [*found.tensors.values(), *(run.trainer.tensors().values() if step == 40 else ())]
    assert all(tensor.isfinite().all() for tensor in saved)


def test_the_sentence_has_the_step(flow: Flow) -> None:
    run = make_run(tiny(), flow)
    Spoiled(run, "loss", math.nan, times=1)
    for _ in range(BAD_STEP):
        run.trainer.advance()
    with pytest.raises(NonFiniteError, match="the loss became NaN .* in step 24"):
        run.trainer.advance()
    assert run.trainer.step == BAD_STEP


def test_the_rollback_uses_half_the_learning_rate_from_the_snapshot_on(flow: Flow) -> None:
    run = make_run(tiny(), flow)
    Spoiled(run, "loss", math.nan, times=1)
    run.train()
    twin = make_trainer(tiny(), flow)
    for step in range(40):
        if step == 20:
            twin.lr_scale = [0.5]
        twin.advance()
    assert torch.equal(run.trainer.params, twin.params)
