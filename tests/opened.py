"""Notices whether a file was opened, by any code of the process, with Linux' inotify."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

_IN_OPEN = 0x20
_LIBC = ctypes.CDLL(None, use_errno=True)


@contextmanager
def watched(path: Path) -> Iterator[Callable[[], bool]]:
    """A function that says whether the file was opened since the start of the block."""
    handle = _LIBC.inotify_init1(os.O_NONBLOCK)
    assert handle >= 0
    assert _LIBC.inotify_add_watch(handle, os.fsencode(path), _IN_OPEN) >= 0

    def opened() -> bool:
        try:
            return bool(os.read(handle, 4096))
        except BlockingIOError:
            return False

    try:
        yield opened
    finally:
        os.close(handle)
