"""Many small jobs, one for each core: simulations of the flows of a study."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

Result = TypeVar("Result")


def on_all_cores(job: Callable[..., Result], *columns: Iterable[Any]) -> list[Result]:
    """`map(job, *columns)` in one process for each core, without the state of this process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=context) as pool:
        return list(pool.map(job, *columns))
