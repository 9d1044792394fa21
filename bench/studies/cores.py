"""Many small jobs, one for each core: simulations of the flows of a study."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

Result = TypeVar("Result")


def processes(spare: int = 0, **settings: Any) -> ProcessPoolExecutor:
    """One process for each core but `spare`, without the state of this process.

    Args:
        settings: of the ProcessPoolExecutor.
    """
    cores = max(1, len(os.sched_getaffinity(0)) - spare)
    return ProcessPoolExecutor(cores, multiprocessing.get_context("spawn"), **settings)


def on_all_cores(job: Callable[..., Result], *columns: Iterable[Any]) -> list[Result]:
    """`map(job, *columns)` in one process for each core, without the state of this process."""
    with processes() as pool:
        return list(pool.map(job, *columns))
