"""Many networks at a time: the ensemble axis of the loss, and steps per second of real training.

Claims: 32 members of 512 points take at most 1.5 times as long as one batch of 16,384 points, and
six cases of 512 points make at least 8,000 steps per second together, in the mixed form.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import torch

from bench.device import graphed, milliseconds
from bench.rivals import STEPS_PER_GRAPH
from bench.steps import Task, fused_step, make_task
from granpinn.config import Config
from granpinn.fit.case import pose
from granpinn.identification.start import start
from granpinn.simulation import demo_path
from granpinn.training.history import Row
from granpinn.training.progress import Silent

ENSEMBLE_GOAL = 1.5
STEPS_GOAL = 8000.0


def guarded(name: str, measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The result of `measure`, or its error, as a row with a name."""
    try:
        return {"name": name} | measure()
    except Exception as error:
        return {"name": name, "error": f"{type(error).__name__}: {error}"}


def ensemble(device: torch.device, members: int, points: int) -> list[dict[str, Any]]:
    """An ensemble with `points` for each member against one network with all points."""

    def step_ms(task: Task, precision: str, update: bool) -> float:
        step = fused_step(task, precision, update)
        if device.type != "cuda":
            return milliseconds(step, device)
        return milliseconds(graphed(step, STEPS_PER_GRAPH), device) / STEPS_PER_GRAPH

    def compared(form: str, precision: str) -> dict[str, Any]:
        one = make_task(form, members * points).to(device)
        many = one.ensemble(members)
        found = {
            f"{name}_ms": step_ms(task, precision, update)
            for update, suffix in ((True, ""), (False, "_loss"))
            for name, task in ((f"one{suffix}", one), (f"many{suffix}", many))
        }
        ratio = found["many_ms"] / found["one_ms"]
        loss_ratio = found["many_loss_ms"] / found["one_loss_ms"]
        goal = {"ratio": ratio, "loss_ratio": loss_ratio, "goal_reached": ratio <= ENSEMBLE_GOAL}
        return found | goal

    return [
        guarded(
            f"{members} x {points} against {members * points}, {form}, {precision}",
            partial(compared, form, precision),
        )
        for form in ("strong", "mixed")
        for precision in ("fp32", "fast")
    ]


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


def training_rate(device: torch.device, members: int, **changes: Any) -> dict[str, Any]:
    """Steps per second of members on the demonstration flow that differ in their seeds."""
    config = Config(**{"device": device.type} | changes)
    first = pose(demo_path(), config)
    cases = [
        replace(first, config=replace(config, seed=seed), member=replace(first.member, seed=seed))
        for seed in range(members)
    ]
    marks = Marks()
    begin = time.monotonic()
    start(cases, config, None, marks, begin, [None] * members).train()
    return {
        "members": members,
        "interior": config.batch.interior,
        "surface": config.batch.surface,
        "widths": list(config.network.widths),
        "form": config.form,
        "steps": config.steps,
        "seconds": time.monotonic() - begin,
        "steps_per_s": marks.rate(config),
    }


def training(device: torch.device, steps: int, tiny: bool = False) -> list[dict[str, Any]]:
    """The six cases of the claim, with the default network and the paper's, and the default batch.

    `tiny` is for trying the command on a CPU.
    """
    common: dict[str, Any] = {"steps": steps}
    six = {"batch__interior": 512, "batch__surface": 64}
    paper = {"network__widths": (250, 250, 250)}
    if tiny:
        common |= {"log_every": 1, "batch__interior": 32, "batch__surface": 8}
        six = {}
    wanted: list[tuple[str, int, dict[str, Any]]] = [
        ("6 cases, 512 + 64 points", 6, six),
        ("6 cases, 512 + 64 points, network 3x250", 6, six | paper),
        ("1 case, default batch", 1, {}),
        ("32 cases, default batch", 32, {"steps": steps // 2}),
    ]
    rows = [
        guarded(
            name,
            partial(training_rate, device, members, **common | changes),
        )
        for name, members, changes in (wanted[:1] if tiny else wanted)
    ]
    for row in rows[:1]:
        if "steps_per_s" in row:
            row["goal_reached"] = row["steps_per_s"] >= STEPS_GOAL
    return rows


def text(ensembles: list[dict[str, Any]], trainings: list[dict[str, Any]]) -> str:
    lines = []
    for row in ensembles + trainings:
        if "error" in row:
            said = row["error"]
        elif "ratio" in row:
            said = f"{row['many_ms']:.3f} / {row['one_ms']:.3f} ms = {row['ratio']:.2f} "
            said += f"(loss alone {row['loss_ratio']:.2f}; goal {ENSEMBLE_GOAL})"
        else:
            said = f"{row['steps_per_s']:.0f} steps/s"
            said += f" (goal {STEPS_GOAL:.0f})" if "goal_reached" in row else ""
        lines.append(f"{row['name']:<50}{said}")
    return "\n".join(lines)
