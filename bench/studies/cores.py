"""Work in processes without the state of this one: one for each core, or one alone."""

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


def alone(job: Callable[..., Result], *arguments: Any) -> Result:
    """`job(*arguments)` in a process of its own: its peak of memory is that of the job."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(job, *arguments).result()


def on_all_cores(job: Callable[..., Result], *columns: Iterable[Any]) -> list[Result]:
    """`map(job, *columns)` in one process for each core, without the state of this process."""
    with processes() as pool:
        return list(pool.map(job, *columns))
