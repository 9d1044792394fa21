"""One optimization step of the strongest rival on the CPU: jitted JAX with hand-written jets.

Claim: the fused step of `test_step.py` is faster, at every batch size. Needs `pip install jax`.
JAX always uses every core, hence no case with one thread: compare process CPU times.
"""

from __future__ import annotations

from typing import Any

import pytest
import torch

from bench.steps import eager_step, make_task
from bench.timing import time_step

pytest.importorskip("jax", reason="pip install jax to time this rival")


@pytest.mark.parametrize("points", [512, 4096])
@pytest.mark.parametrize("form", ["strong", "mixed"])
@pytest.mark.parametrize("threads", ["all"], indirect=True)
def test_jax_step(benchmark: Any, form: str, points: int, threads: int) -> None:
    from bench.jax_step import jax_step

    task = make_task(form, points)
    time_step(benchmark, "JAX jets", task, jax_step(task), threads, rounds=10)


@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_jax_does_the_same(form: str) -> None:
    """Both rivals solve the same problem: three steps of Adam on the same unknowns, in float64."""
    from bench.jax_step import jax_step

    task = make_task(form, 64, torch.float64)
    ours, theirs = (
        torch.stack([advance() for _ in range(3)]) for advance in (eager_step(task), jax_step(task))
    )
    torch.testing.assert_close(theirs, ours, rtol=1e-9, atol=0)
