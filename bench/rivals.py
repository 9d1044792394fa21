"""Every way to make one optimization step on a GPU, and the measurement of one of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import torch

from bench.device import Advance, graphed, milliseconds, peak_memory
from bench.steps import Task, eager_step, fused_step, make_task

OURS = {"fp32": "granpinn fp32", "fast": "granpinn fast"}
SMALL = 4096  # up to here a graph holds ten steps: a launch takes as long as the step
STEPS_PER_GRAPH = 10
Sizes = dict[str, tuple[int, ...]]
SIZES: Sizes = {"strong": (512, 4096, 32768, 262144), "mixed": (512, 32768, 262144)}
QUICK_SIZES: Sizes = {"strong": (512, 32768), "mixed": (512, 32768)}
TINY_SIZES: Sizes = {"strong": (32,), "mixed": (32,)}  # to try the command on a CPU


@dataclass(frozen=True)
class Rival:
    """One line of the table.

    Attributes:
        graph: whether its steps are captured in a CUDA graph.
    """

    name: str
    make: Callable[[Task], Advance]
    graph: bool


GRANPINN = [Rival(name, partial(fused_step, precision=p), True) for p, name in OURS.items()]
OTHERS = [
    Rival("torch eager autograd", eager_step, False),
    Rival("torch eager autograd + graph", eager_step, True),
]


def measure(rival: Rival, form: str, points: int, device: torch.device) -> dict[str, Any]:
    """Time and memory of a step; an error is part of the row."""
    row: dict[str, Any] = {"name": rival.name, "form": form, "points": points}
    use_graph = rival.graph and device.type == "cuda"
    steps = STEPS_PER_GRAPH if use_graph and points <= SMALL else 1
    task = make_task(form, points).to(device)
    try:
        with peak_memory(device) as peak:
            step = rival.make(task)
            advance = graphed(step, steps) if use_graph else step
            ms = milliseconds(advance, device) / steps
            if not math.isfinite(loss := float(advance())):
                raise ArithmeticError(f"the loss became {loss}")
            row["ms"] = ms
            if (found := peak()) is not None:
                row["peak_gb"] = found / 1e9
    except Exception as error:  # the other rivals are measured after any error of this one
        lines = str(error).strip().splitlines()
        row["error"] = f"{type(error).__name__}: {lines[0][:300] if lines else ''}"
    return row
