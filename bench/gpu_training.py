"""Many networks at a time: the ensemble axis of the loss, and the rate of a training.

Claim: 32 members of 512 points take at most 1.5 times as long as one batch of 16,384 points.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import torch

from bench.device import graphed, milliseconds
from bench.rivals import STEPS_PER_GRAPH
from bench.steps import Task, fused_step, make_task
from granpinn.config import Config
from granpinn.training.history import Row
from granpinn.training.progress import Silent

ENSEMBLE_GOAL = 1.5


def ensemble(device: torch.device, members: int, points: int) -> list[dict[str, Any]]:
    """An ensemble with `points` for each member against one network with all points."""

    def step_ms(task: Task, precision: str) -> float:
        step = fused_step(task, precision)
        if device.type != "cuda":
            return milliseconds(step, device)
        return milliseconds(graphed(step, STEPS_PER_GRAPH), device) / STEPS_PER_GRAPH

    rows = []
    for form, precision in product(("strong", "mixed"), ("fp32", "fast")):
        one = make_task(form, members * points).to(device)
        one_ms, many_ms = (step_ms(task, precision) for task in (one, one.ensemble(members)))
        row = {"form": form, "precision": precision, "members": members, "points": points}
        row |= {"one_ms": one_ms, "many_ms": many_ms, "ratio": many_ms / one_ms}
        rows.append(row | {"goal_reached": many_ms / one_ms <= ENSEMBLE_GOAL})
    return rows


@dataclass
class Marks(Silent):
    """Records the time of every row of the history: (step, seconds)."""

    marks: list[tuple[int, float]] = field(default_factory=list)

    def show(self, row: Row) -> None:
        self.marks.append((row.step, time.monotonic()))

    def rate(self, config: Config) -> float:
        """Steps per second with the whole loss, from the third row on, after all graph captures."""
        assert config.steps is not None
        begin = config.optimizer.prefit * config.steps + 2 * config.log_every
        whole = [mark for mark in self.marks if mark[0] >= begin]
        (first, since), (last, until) = whole[0], whole[-1]
        return (last - first) / (until - since)
