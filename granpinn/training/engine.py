"""What runs the steps of a stretch: plain calls, or captured CUDA graphs that are replayed.

A graph repeats its kernels on the same memory, without Python and without launching them one by
one. Numbers that Python passed by value are frozen in it, which is why a step takes everything
that changes from tensors on the device (granpinn/training/control.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import torch
from torch import Tensor

from granpinn.training.objective import Evaluation

STEPS_PER_GRAPH = 10

OneStep = Callable[[bool], Evaluation]
Replay = Callable[[], None]


class Engine(Protocol):
    """Attributes:
    many: whether a stretch may be more than one step.
    """

    many: bool

    def run(self, steps: int, velocity_alone: bool) -> Evaluation:
        """Make the steps, all of one kind; what the last one evaluated."""


class Eager:
    """Calls the step."""

    many = False

    def __init__(self, one_step: OneStep) -> None:
        self.one_step = one_step

    def run(self, steps: int, velocity_alone: bool) -> Evaluation:
        for _ in range(steps):
            e = self.one_step(velocity_alone)
        return e


class Graphs:
    """Replays graphs of ten steps and of one, captured when they are first needed.

    Args:
        one_step: the step to capture; it must not wait for the device.
        state: every tensor that a step changes; they must stay where they are.
        capture: makes a graph of a function without running it, by default a CUDA graph.
    """

    many = True

    def __init__(
        self,
        one_step: OneStep,
        state: Iterable[Tensor],
        capture: Callable[[Callable[[], Evaluation]], tuple[Replay, Evaluation]] | None = None,
    ) -> None:
        self.one_step = one_step
        self.state = list(state)
        self.capture = capture or CudaCapture()
        self._graphs: dict[tuple[int, bool], tuple[Replay, Evaluation]] = {}

    def run(self, steps: int, velocity_alone: bool) -> Evaluation:
        for size in (STEPS_PER_GRAPH, 1):
            repeats, steps = divmod(steps, size)
            if repeats:
                replay, e = self._graph(size, velocity_alone)
                for _ in range(repeats):
                    replay()
        return e

    def _graph(self, size: int, velocity_alone: bool) -> tuple[Replay, Evaluation]:
        """The graph of so many steps; its evaluation is overwritten by every replay."""
        key = (size, velocity_alone)
        if key not in self._graphs:

            def steps() -> Evaluation:
                for _ in range(size):
                    e = self.one_step(velocity_alone)
                return e

            kept = [tensor.clone() for tensor in self.state]
            self._graphs[key] = self.capture(steps)
            for tensor, value in zip(self.state, kept, strict=True):
                tensor.copy_(value)
        return self._graphs[key]


class CudaCapture:
    """Captures into CUDA graphs that share their memory: they never run at the same time."""

    def __init__(self) -> None:
        self.pool = torch.cuda.graph_pool_handle()

    def __call__(self, steps: Callable[[], Evaluation]) -> tuple[Replay, Evaluation]:
        side = torch.cuda.Stream()  # type: ignore[no-untyped-call]
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):  # what is set up on first use must not be captured
            steps()
        torch.cuda.current_stream().wait_stream(side)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph, pool=self.pool, capture_error_mode="thread_local"):
            e = steps()
        return graph.replay, e


def engine(one_step: OneStep, state: Iterable[Tensor], device: torch.device) -> Engine:
    """Graphs on a GPU, plain calls elsewhere."""
    return Graphs(one_step, state) if device.type == "cuda" else Eager(one_step)
