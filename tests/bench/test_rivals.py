"""The rows of the rivals of the GPU benchmark."""

from __future__ import annotations

import torch

from bench import cache, rivals
from bench.machine import describe
from bench.rivals import Rival
from bench.steps import Task, eager_step, make_task

CPU = torch.device("cpu")


def test_what_stays_from_step_to_step() -> None:
    task: Task = make_task("strong", 16)
    tensors = 4 * (task.params.numel() + task.theta.numel()) + task.points.numel()
    assert task.resident == 4 * (tensors + task.velocity.numel())
    row = rivals.measure(Rival("eager", eager_step, False), "strong", 16, CPU).row
    assert row["resident_mb"] == task.resident / 1e6
    assert "ms_alone_cold" not in row  # a CPU has no cache to overwrite here
    assert cache.cache_bytes(CPU) is None


def test_a_benchmark_states_the_processor() -> None:
    assert len(describe()["processor"]) > 3
