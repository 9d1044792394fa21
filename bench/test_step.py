"""One optimization step on the CPU: fused against the usual ways to train a PINN.

Claims:
- fused, strong form: at least 6.5 times faster than eager autograd per core, at every batch size
  (on a processor with AVX-512; the goal of 12.5 ms per 512 points is at 276 GFLOP/s per core).
- mixed form: at most 0.6 times the strong form.
- two threads: at least 1.85 times one.

pytest-benchmark times the wall clock; `extra_info` has process CPU time, which neighbours on the
machine disturb less, and the rate per core of the step's matrix products.
"""

from __future__ import annotations

from typing import Any

import pytest
import torch

from bench.steps import STEPS, make_task
from bench.timing import time_step


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("points", [512, 4096])
@pytest.mark.parametrize("form", ["strong", "mixed"])
@pytest.mark.parametrize("threads", [1, "all"], indirect=True, ids=["t1", "all"])
def test_step(benchmark: Any, form: str, points: int, step: str, threads: int) -> None:
    task = make_task(form, points)
    rounds = 20 if step == "fused" else 5
    time_step(benchmark, step, task, STEPS[step](task), threads, rounds)


@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_all_steps_do_the_same(form: str) -> None:
    """Rivals solve the same problem: their losses agree in float64.

    Only the first loss is compared: granpinn's Adam moves mu(I) in other variables.
    """
    losses = [make(make_task(form, 64, torch.float64))() for make in STEPS.values()]
    torch.testing.assert_close(losses[1], losses[0], rtol=1e-9, atol=0)
