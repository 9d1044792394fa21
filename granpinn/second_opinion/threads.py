"""Threads that an error or a signal does not wait for."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from threading import Event

from granpinn.simulation.engine import StepReport
from granpinn.simulation.progress import Silent


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


class UntilStopped(Silent):
    """A listener that ends its run in the next step once an event is set."""

    def __init__(self, stopped: Event) -> None:
        self._stopped = stopped

    def show(self, report: StepReport) -> None:
        if self._stopped.is_set():
            raise CancelledError
