"""SIGINT, SIGTERM and SIGHUP: handlers that a command or a training sets, and gives back.

A signal that is ignored stays ignored: with nohup, and for jobs in the background of a script. Only
the main thread can set a handler. This module loads only the standard library.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from granpinn.errors import Interrupted

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
Handler = Callable[[int, FrameType | None], None]


def set_handler(handler: Handler) -> dict[signal.Signals, Handler | int]:
    """Set the handler of the signals; returns those before, of the signals that were changed."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    found = {number: signal.getsignal(number) for number in SIGNALS}
    before = {n: h for n, h in found.items() if h is not None and h is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, handler)
    return before


@contextmanager
def handled_by(handler: Handler) -> Iterator[None]:
    """Set the handler of the signals inside the block."""
    before = set_handler(handler)
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


class Signals:
    """Holds the number of the first signal; a second one ends the process at once."""

    def __init__(self) -> None:
        self.received: int | None = None
        self._message: str | None = None

    def handle(self, signum: int, frame: FrameType | None) -> None:
        if self.received is not None and signum == signal.SIGHUP:
            return  # a terminal that closes may send two
        if self.received is not None:
            os._exit(128 + signum)
        self.received = signum
        if self._message is not None:
            raise Interrupted(signum, self._message)

    def stop_at_once(self, message: str) -> None:
        """From now on the first signal raises Interrupted, wherever it arrives."""
        self._message = message
        if self.received is not None:
            raise Interrupted(self.received, message)


@contextmanager
def caught() -> Iterator[Signals]:
    """Hold the signals that arrive inside the block, instead of ending the process."""
    signals = Signals()
    with handled_by(signals.handle):
        yield signals
