"""Memory of one step on the CPU.

Claim: the peak of the fused step beyond its inputs does not grow with the number of points. Points
pass in tiles, and nothing is stored for a backward pass. Eager autograd needs gigabytes.
"""

from __future__ import annotations

from typing import Any

import pytest

from bench.memory import peak_in_process

FUSED = [4096, 16_384, 65_536]


@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_fused_memory_is_flat(benchmark: Any, form: str) -> None:
    def measure() -> dict[int, float]:
        return {points: peak_in_process(form, "fused", points) for points in FUSED}

    megabytes = benchmark.pedantic(measure, rounds=1)
    benchmark.extra_info.update(form=form, step="fused", peak_megabytes=megabytes)
    # one page of noise per thread and allocator, not the 24 bytes a point of one more copy of x
    assert megabytes[65_536] <= megabytes[4096] + 1


@pytest.mark.parametrize("form", ["strong", "mixed"])
def test_eager_memory(benchmark: Any, form: str) -> None:
    def measure() -> dict[int, float]:
        return {points: peak_in_process(form, "eager autograd", points) for points in FUSED[:1]}

    megabytes = benchmark.pedantic(measure, rounds=1)
    benchmark.extra_info.update(form=form, step="eager autograd", peak_megabytes=megabytes)
