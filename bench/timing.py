"""Timing of one optimization step, the same for every rival."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

from bench.steps import Task


def time_step(
    benchmark: Any, name: str, task: Task, advance: Callable[[], Any], threads: int, rounds: int
) -> None:
    """Time `advance` with pytest-benchmark; adds process CPU time and the rate to extra_info."""
    cpu: list[float] = []

    def timed() -> None:
        start = time.process_time()
        advance()
        cpu.append(time.process_time() - start)

    benchmark.pedantic(timed, rounds=rounds, warmup_rounds=2)
    cpu_ms = 1e3 * statistics.median(cpu[2:])
    benchmark.extra_info.update(
        form=task.form,
        points=len(task.points),
        step=name,
        threads=threads,
        cpu_ms=round(cpu_ms, 3),
        wall_ms=round(1e3 * benchmark.stats["median"], 3),
        gflops=round(task.flop / (1e6 * cpu_ms), 1),
    )
