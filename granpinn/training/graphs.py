"""Steps as CUDA graphs, which are captured once and replayed.

A graph repeats its kernels on the same memory, without Python and without single launches. Numbers
that Python passes by value are constants of the graph. A step therefore reads all changing numbers
from tensors on the device (granpinn/training/schedule.py).
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import torch
from torch import Tensor

from granpinn.training.objective import Evaluation

STEPS_PER_GRAPH = 10

Replay = Callable[[], None]


class Graphs:
    """Replays graphs of ten steps and of one, captured at their first use.

    Args:
        one_step: the step to capture, a function of `prefit`; it must not wait for the device.
        state: every tensor that a step changes; their memory must stay the same.
        capture: makes a graph of a function without running it, by default a CUDA graph.
    """

    def __init__(
        self,
        one_step: Callable[[bool], Evaluation],
        state: Iterable[Tensor],
        capture: Callable[[Callable[[], Evaluation]], tuple[Replay, Evaluation]] | None = None,
    ) -> None:
        self.one_step = one_step
        self.state = list(state)
        self.capture = capture or CudaCapture()
        self._graphs: dict[tuple[int, bool], tuple[Replay, Evaluation]] = {}

    def run(self, steps: int, prefit: bool) -> Evaluation:
        """Make the steps, all of one kind; the evaluation of the last one."""
        for size in (STEPS_PER_GRAPH, 1):
            repeats, steps = divmod(steps, size)
            if repeats:
                replay, e = self._graph(size, prefit)
                for _ in range(repeats):
                    replay()
        return e

    def _graph(self, size: int, prefit: bool) -> tuple[Replay, Evaluation]:
        """The graph of so many steps; every replay overwrites its evaluation."""
        key = (size, prefit)
        if key not in self._graphs:

            def steps() -> Evaluation:
                for _ in range(size):
                    e = self.one_step(prefit)
                return e

            kept = [tensor.clone() for tensor in self.state]
            self._graphs[key] = self.capture(steps)
            for tensor, value in zip(self.state, kept, strict=True):
                tensor.copy_(value)
        return self._graphs[key]


class CudaCapture:
    """Captures CUDA graphs that share their memory: they never run at the same time."""

    def __init__(self) -> None:
        self.pool = torch.cuda.graph_pool_handle()

    def __call__(self, steps: Callable[[], Evaluation]) -> tuple[Replay, Evaluation]:
        side = torch.cuda.Stream()  # type: ignore[no-untyped-call]
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):  # the set-up of the first use must not be captured
            steps()
        torch.cuda.current_stream().wait_stream(side)
        graph = torch.cuda.CUDAGraph()
        with (
            _without_collection(),
            torch.cuda.graph(graph, pool=self.pool, capture_error_mode="thread_local"),
        ):
            e = steps()
        return graph.replay, e


@contextmanager
def _without_collection() -> Iterator[None]:
    """No garbage collection inside: a graph of an earlier run that it frees ends the capture."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
