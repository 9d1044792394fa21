"""Pools of threads that an error does not wait for."""

from __future__ import annotations

import threading
from concurrent.futures import CancelledError, Future

import pytest

from granpinn.second_opinion.threads import Threads, threads


def stop(pools: list[Threads]) -> None:
    """Leave the block of a pool by an error, as a signal does."""
    with threads(1) as pool:
        pools.append(pool)
        raise KeyboardInterrupt


def test_work_that_an_error_ended_gives_no_more_work() -> None:
    """A thread that still runs is told that the run stops, not that there is a bug."""
    pools: list[Threads] = []
    with pytest.raises(KeyboardInterrupt):
        stop(pools)
    with pytest.raises(CancelledError):
        pools[0].submit(print)


def test_an_error_does_not_wait_for_work_that_runs() -> None:
    begun, ended = threading.Event(), threading.Event()
    waiting: list[Future[None]] = []

    def work() -> None:
        begun.set()
        assert ended.wait(60)

    def fail() -> None:
        with threads(1) as pool:
            running = pool.submit(work)
            waiting.extend((running, pool.submit(work)))
            assert begun.wait(60)
            raise ValueError("stop")

    with pytest.raises(ValueError, match="stop"):
        fail()
    running, cancelled = waiting
    assert running.running()
    assert cancelled.cancelled()
    ended.set()
    running.result(60)
