"""Threads that an error or a signal does not wait for."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager


@contextmanager
def threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of `count` threads; an error leaves the block at once and cancels their work.

    The executor's own context would wait for all work that has been submitted.
    """
    pool = ThreadPoolExecutor(count)
    finished = False
    try:
        yield pool
        finished = True
    finally:
        pool.shutdown(wait=finished, cancel_futures=not finished)
