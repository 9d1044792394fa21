"""Timing of a step on a GPU: device events and peak memory.

A CPU can only try out the GPU benchmark: there the wall clock takes the place of events, and the
memory is None.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import torch

Advance = Callable[[], Any]
SAMPLE_MS = 2.0  # duration of a sample, which has several steps
ROUNDS = (5, 50)


def milliseconds(advance: Advance, device: torch.device, seconds: float = 0.3) -> float:
    """Median time of a step over samples of several steps, measured for about `seconds`."""
    for _ in range(3):
        advance()
    once = _sample(advance, 1, device)
    repeats = max(1, round(SAMPLE_MS / once))
    low, high = ROUNDS
    rounds = max(low, min(high, int(1e3 * seconds / (once * repeats))))
    return statistics.median(_sample(advance, repeats, device) / repeats for _ in range(rounds))


def _sample(advance: Advance, repeats: int, device: torch.device) -> float:
    if device.type != "cuda":
        begin = time.perf_counter()
        for _ in range(repeats):
            advance()
        return 1e3 * (time.perf_counter() - begin)
    event: Any = torch.cuda.Event
    start, end = event(enable_timing=True), event(enable_timing=True)
    torch.cuda.synchronize()
    start.record()
    for _ in range(repeats):
        advance()
    end.record()
    end.synchronize()
    return float(start.elapsed_time(end))


def graphed(step: Advance, steps: int) -> Advance:
    """A number of steps, captured in a CUDA graph that every call replays."""
    side = torch.cuda.Stream()  # type: ignore[no-untyped-call]
    side.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(side):
        for _ in range(3):
            step()
    torch.cuda.current_stream().wait_stream(side)
    torch.cuda.synchronize()
    torch.cuda.empty_cache()
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        for _ in range(steps):
            last = step()

    def replay(kept: Any = last, alive: Advance = step) -> Any:
        """`alive` has the tensors that the graph reads: they must live as long as it."""
        graph.replay()
        return kept

    return replay


@contextmanager
def peak_memory(device: torch.device) -> Iterator[Callable[[], int | None]]:
    """Gives a function: peak bytes of the tensors that the block has allocated so far."""
    on_gpu, before = device.type == "cuda", 0
    gc.collect()
    if on_gpu:
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats()
        before = torch.cuda.memory_allocated()
    yield lambda: torch.cuda.max_memory_allocated() - before if on_gpu else None
