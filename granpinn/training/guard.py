"""Numbers that are not finite, and signals: either can stop a run.

Loss and gradients are tested before the update that uses them, the parameters after it. So a NaN is
found in the step that makes it (csrc/step.h; `ControlTable.faults` reads the result). The first
time, the training loop goes back to its last good state, at half the learning rate: this helps if
the steps were too long. The second time the run stops and names the tensor. If the run has several
members, only the faulty ones stop.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType

import torch
from torch import Tensor

from granpinn.errors import CannotGoOn, Interrupted


class NonFiniteError(CannotGoOn):
    """A tensor of the training state holds a NaN or an infinity; the message names it.

    Attributes:
        members: the faulty members of the run, each with its own sentence.
    """

    def __init__(self, message: str, members: Mapping[int, str] | None = None) -> None:
        super().__init__(message)
        self.members = dict(members or {})


def require_finite(tensors: Mapping[str, Tensor]) -> None:
    """Raise NonFiniteError for data with a NaN or an infinity."""
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            bad = int((~torch.isfinite(tensor)).sum())
            raise NonFiniteError(
                f"the {name} of the training set hold {bad} values that are NaN or infinite: "
                f"points without a valid vector must be left out of the flow file (NaN there)"
            )


class Signals:
    """Holds the number of the first SIGINT or SIGTERM; a second one ends the process at once."""

    def __init__(self) -> None:
        self.received: int | None = None
        self._message: str | None = None

    def handle(self, signum: int, frame: FrameType | None) -> None:
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
def signals() -> Iterator[Signals]:
    """Catch SIGINT and SIGTERM inside the block, unless they are ignored.

    Outside the main thread nothing is caught.
    """
    caught = Signals()
    if threading.current_thread() is not threading.main_thread():
        yield caught
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    # A signal that is ignored stays so: with nohup, and for jobs in the background of a script.
    before = {n: h for n, h in before.items() if h is not None and h is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, caught.handle)
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
