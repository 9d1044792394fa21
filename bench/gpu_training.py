"""Many networks at a time: the ensemble axis of the loss.

Claim: 32 members of 512 points take at most 1.5 times as long as one batch of 16,384 points.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import torch

from bench.device import graphed, milliseconds
from bench.rivals import STEPS_PER_GRAPH
from bench.steps import Task, fused_step, make_task

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
