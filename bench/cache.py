"""What the second-level cache of a GPU has to do with the time of a step.

In a training, a step begins with the weights where the step before has left them. Steps are thus
timed one after another. For small batches, a step by itself is timed twice more: with the cache as
the step before has left it, and with all of it overwritten before.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any

import torch

from bench.device import Advance

ROUNDS = 50
BUSY_CYCLES = 600_000  # of the GPU, about 0.3 ms: longer than the host needs to launch a graph


def cache_bytes(device: torch.device) -> int | None:
    """Size of the second-level cache."""
    if device.type != "cuda":
        return None
    return int(torch.cuda.get_device_properties(device).L2_cache_size)


def alone(advance: Advance, device: torch.device) -> dict[str, float]:
    """ms of a step by itself, with its data in the cache (warm) and without (cold).

    Before both, the GPU is kept busy, so that the time of the launch does not count.
    """
    size = cache_bytes(device) or 0
    other = torch.empty(2 * size, dtype=torch.uint8, device=device)

    def busy() -> None:
        torch.cuda._sleep(BUSY_CYCLES)  # type: ignore[no-untyped-call]

    def overwrite() -> None:
        other.fill_(1)
        busy()

    found = {"ms_alone_warm": busy, "ms_alone_cold": overwrite}
    return {name: _median(advance, before) for name, before in found.items()}


def _median(advance: Advance, before: Callable[[], None]) -> float:
    event: Any = torch.cuda.Event
    samples = []
    for _ in range(ROUNDS):
        start, end = event(enable_timing=True), event(enable_timing=True)
        before()
        start.record()
        advance()
        end.record()
        end.synchronize()
        samples.append(float(start.elapsed_time(end)))
    return statistics.median(samples)
