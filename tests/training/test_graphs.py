"""Replayed graphs: a step reads changing numbers from tensors and never waits for the device.

A CUDA graph repeats kernels on the same memory with the numbers that they were captured with. The
recording below does just that on any device: it repeats the operators of a step with the same
arguments and writes their results to the same memory. Numbers that Python passes by value would
stay the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from granpinn.config import Config
from granpinn.data import Flow
from granpinn.training.graphs import Graphs
from granpinn.training.guard import NonFiniteError
from granpinn.training.objective import Evaluation, Objective
from granpinn.training.schedule import Schedule
from granpinn.training.trainer import Trainer
from tests.runs import make_objective, make_trainer, tiny

WAITING = {torch.ops.aten._local_scalar_dense.default, torch.ops.aten.nonzero.default}


class Recording(TorchDispatchMode):
    """The operators that are called, with their arguments and results."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[tuple[Any, Any, Any, Any]] = []

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):  # type: ignore[no-untyped-def]
        assert func not in WAITING, f"{func} waits for the device"
        result = func(*args, **(kwargs or {}))
        self.calls.append((func, args, kwargs or {}, result))
        return result

    def replay(self) -> None:
        for func, args, kwargs, result in self.calls:
            again = func(*args, **kwargs)
            for old, new in zip(tree_leaves(result), tree_leaves(again), strict=True):
                if isinstance(old, Tensor) and old.data_ptr() != new.data_ptr():
                    old.copy_(new)


def record(steps: Callable[[], Evaluation]) -> tuple[Callable[[], None], Evaluation]:
    with Recording() as recording:
        e = steps()
    return recording.replay, e


def graphed(config: Config, flow: Flow) -> Trainer:
    trainer = make_trainer(config, flow)
    trainer.graphs = Graphs(trainer.one_step, trainer.changing(), record)
    return trainer


def at_step(trainer: Trainer, step: int) -> None:
    """Make the device ready for a step."""
    trainer.control.prepare(trainer.schedule, step, trainer.misfit, 1, [1.0], ())


def assert_same(one: Trainer, other: Trainer) -> None:
    for name, tensor in one.tensors().items():
        assert torch.equal(tensor, other.tensors()[name]), name
    assert one.plain_state() == other.plain_state()
    assert repr(one.rows(0.0)) == repr(other.rows(0.0))


CONFIGS: dict[str, dict[str, Any]] = {
    "muon": {"log_every": 13, "steps": 60},
    "adam": {"optimizer__method": "adam", "log_every": 12, "steps": 45},
    "strong": {"form": "strong", "log_every": 300, "steps": 310},
}


@pytest.mark.parametrize("name", CONFIGS)
def test_replayed_steps_have_the_bits_of_called_ones(name: str, flow: Flow) -> None:
    config = tiny(**CONFIGS[name])
    eager, graphs = make_trainer(config, flow), graphed(config, flow)
    stretches = []
    while not graphs.finished:
        before = graphs.step
        graphs.advance()
        stretches.append(graphs.step - before)
        while eager.step < graphs.step:
            eager.advance()
        assert_same(eager, graphs)
    assert max(stretches) >= 10
    assert config.log_every == 300 or max(stretches) <= config.log_every
    assert graphs.misfit[0] > 0


def test_a_new_schedule_and_smaller_steps_reach_captured_graphs(flow: Flow) -> None:
    config = tiny(steps=80, log_every=20)
    eager, graphs = make_trainer(config, flow), graphed(config, flow)
    for trainer in (eager, graphs):
        while trainer.step < 40:
            trainer.advance()
        trainer.schedule = trainer.schedule.ending_at(100, step=40)
        while trainer.step < 60:
            trainer.advance()
        trainer.remember()
        while trainer.step < 80:
            trainer.advance()
        trainer.roll_back([0])
        assert trainer.step == 60
        while not trainer.finished:
            trainer.advance()
        assert trainer.step == 100
    assert_same(eager, graphs)


def test_a_fault_inside_a_stretch_is_dated_to_its_step(flow: Flow) -> None:
    config = tiny(log_every=20, optimizer__prefit=0.0)
    graphs = graphed(config, flow)
    graphs.advance()
    graphs.objective.term_weights.fill_(math.nan)
    before = graphs.params.clone()
    with pytest.raises(NonFiniteError, match="the loss became NaN or infinite in step 21"):
        graphs.advance()
    assert graphs.step == 20
    assert torch.equal(graphs.params, before)


def test_all_steps_of_a_kind_are_the_same_calls(flow: Flow) -> None:
    """The same operators on the same tensors of the state with the same numbers."""
    trainer = make_trainer(tiny(), flow)
    state = {t.data_ptr() for t in trainer.changing()}

    def calls(step: int, prefit: bool) -> list[Any]:
        at_step(trainer, step)
        with Recording() as recording:
            trainer.one_step(prefit)
        return [
            (func, [leaf for leaf in map(constant, tree_leaves((args, kwargs))) if leaf])
            for func, args, kwargs, _ in recording.calls
        ]

    def constant(leaf: Any) -> Any:
        if isinstance(leaf, Tensor):
            return leaf.data_ptr() if leaf.data_ptr() in state else None
        return repr(leaf)

    with torch.no_grad():
        for alone, steps in ((True, (0, 7)), (False, (12, 39))):
            first, second = (calls(step, alone) for step in steps)
            assert first == second
            assert len(first) < 30


@pytest.mark.parametrize("precision", ["fp32", "fast"])
def test_the_precision_reaches_all_products_of_a_step(precision: str, flow: Flow) -> None:
    trainer = make_trainer(tiny(precision=precision), flow)
    at_step(trainer, 0)
    with torch.no_grad(), Recording() as recording:
        trainer.one_step(False)
    found = {
        func.name().removeprefix("granpinn::"): args[names.index("precision")]
        for func, args, _, _ in recording.calls
        if "precision" in (names := [argument.name for argument in func._schema.arguments])
    }
    assert found == {"batch_loss": precision, "descend": precision}


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
@pytest.mark.parametrize("name", CONFIGS)
def test_cuda_graphs_make_the_steps_of_the_cpu(name: str, flow: Flow) -> None:
    config = tiny(dtype="float64", **CONFIGS[name])
    cpu = make_trainer(config, flow)
    device = torch.device("cuda")
    objective = Objective(cpu.objective.members, config.batch, device)
    cuda = Trainer(objective, cpu.schedule, config)
    called = Trainer(objective, cpu.schedule, config)
    called.graphs = None
    while not cuda.finished:
        cuda.advance()
        for other in (cpu, called):
            while other.step < cuda.step:
                other.advance()
    for key, tensor in cuda.tensors().items():
        assert torch.equal(tensor, called.tensors()[key]), key
        torch.testing.assert_close(tensor.cpu(), cpu.tensors()[key], rtol=1e-6, atol=1e-8)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
@pytest.mark.parametrize("precision", ["fp32", "fast"])
def test_cuda_graphs_have_the_bits_of_called_steps(precision: str, flow: Flow) -> None:
    """In float32, where kernels start early and Muon's descent takes one launch."""
    config = tiny(precision=precision, **CONFIGS["muon"])
    members, schedule = make_objective(config, flow).members, Schedule(60, config.optimizer)
    objective = Objective(members, config.batch, torch.device("cuda"), precision=precision)
    called, *graphs = (Trainer(objective, schedule, config) for _ in range(3))
    called.graphs = None
    for trainer in (called, *graphs):
        while not trainer.finished:
            trainer.advance()
    for trainer in graphs:
        assert_same(called, trainer)
