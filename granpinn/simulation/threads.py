"""Threads that an error or a signal does not wait for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any


class Threads(ThreadPoolExecutor):
    """A pool whose threads may give work to each other until an error ends all of it."""

    stopping = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """As usual; CancelledError once an error has ended the work."""
        try:
            return super().submit(fn, *args, **kwargs)
        except RuntimeError as error:
            if self.stopping:
                raise CancelledError from error
            raise


@contextmanager
def threads(count: int) -> Iterator[Threads]:
    """Yield a pool of `count` threads; an error leaves the block at once and cancels their work.

    The executor's own context would wait for all work that has been submitted.
    """
    pool = Threads(count)
    finished = False
    try:
        yield pool
        finished = True
    finally:
        pool.stopping = not finished
        pool.shutdown(wait=finished, cancel_futures=not finished)
