"""Pools of threads that an error does not wait for."""

from __future__ import annotations

import threading
from concurrent.futures import Future

import pytest

from granpinn.identification.threads import threads


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
