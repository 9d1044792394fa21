"""Starts the process that opens foreign files, asks it, and maps its answers."""

from __future__ import annotations

import atexit
import json
import mmap
import os
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import granpinn
from granpinn.regular import UnsafeFileError

SECONDS = 6.0  # of processor time: a command asks twice at most about a file
WAITING = 2.5  # times that, in all: the machine may be busy with other things
BYTES_PER_SECOND = 2**20
START_SECONDS = 120.0  # for the imports of the library
# Memory of a reading: packed data of a valid file unpack to a few times their size.
LEAST_BYTES = 2**30
BYTES_PER_BYTE = 50
MOST_BYTES = 2**34
HEADER = 16  # bytes of an answer: place and length of its JSON in the memory file


class _Crashed(Exception):
    """The process has ended, or did not answer in time."""


class _Process:
    def __init__(self) -> None:
        self.owner = os.getpid()
        self._channel, theirs = socket.socketpair()
        folder = str(Path(granpinn.__file__).parents[1])
        paths = [folder, *filter(None, [os.environ.get("PYTHONPATH")])]
        few = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
        without_plugins = {"HDF5_PLUGIN_PRELOAD": "::"}
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "granpinn.foreign.program"],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), **few, **without_plugins},
                start_new_session=True,  # an interrupt at the terminal is for this process only
            )

    def ask(self, request: dict[str, Any], seconds: float) -> Any:
        """The answer to a request, with its arrays."""
        try:
            self._channel.settimeout(START_SECONDS)
            self._channel.sendall(json.dumps(request).encode() + b"\n")
            if self._channel.recv(1) == b"":
                raise _Crashed
            self._channel.settimeout(seconds)
            header, handles, *_ = socket.recv_fds(self._channel, HEADER, 1)
            if len(header) != HEADER or not handles:
                raise _Crashed
        except OSError:
            raise _Crashed from None
        try:
            content = mmap.mmap(handles[0], 0, access=mmap.ACCESS_COPY)
        finally:
            os.close(handles[0])
        at, length = (int.from_bytes(header[k : k + 8], "little") for k in (0, 8))
        return json.loads(
            content[at : at + length], object_hook=lambda part: _with_array(part, content)
        )

    def close(self) -> None:
        """Ends the process."""
        self.process.kill()
        self.process.wait()
        self._channel.close()


def _with_array(part: dict[str, Any], content: mmap.mmap) -> Any:
    """The array that a part of an answer stands for, as `program.Answer.keep` makes it."""
    if part.keys() != {"at", "dtype", "shape"}:
        return part
    count = int(np.prod(part["shape"]))
    return np.frombuffer(content, part["dtype"], count, part["at"]).reshape(part["shape"])


_lock = threading.Lock()
_running: list[_Process] = []


@atexit.register
def _close() -> None:
    while _running:
        _running.pop().close()


def start() -> None:
    """Start the process, whose imports take half a second: the first request finds it ready."""
    with _lock, suppress(OSError):  # a request tries again, and says why it failed
        if not _running:
            _running.append(_Process())


def read_foreign(
    reader: str,
    path: Path,
    n_bytes: int,
    *,
    max_bytes: int | None = None,
    **request: Any,
) -> Any:
    """What a reader gives for a file: JSON, in which arrays are NumPy arrays.

    Args:
        reader: the name of a module of this package.
        n_bytes: size of all files that belong to it; it limits time and memory.
        max_bytes: of all arrays; by default from the size of the files.
        request: further arguments of the reader.

    Raises:
        UnsafeFileError: the reader refuses the file, crashes on it, or takes too long.
    """
    limit = max_bytes or min(max(LEAST_BYTES, BYTES_PER_BYTE * n_bytes), MOST_BYTES)
    seconds = SECONDS + n_bytes / BYTES_PER_SECOND
    asked = {"reader": reader, "path": str(path.absolute()), **request}
    asked |= {"max_bytes": limit, "seconds": seconds}
    with _lock:
        if _running and _running[0].owner != os.getpid():  # that of the process before a fork
            _running.clear()
        answer = None
        while answer is None:
            fresh = not _running
            try:
                if fresh:
                    _running.append(_Process())
                answer = _running[0].ask(asked, WAITING * seconds)
            except _Crashed:
                _close()
                if fresh:  # else an earlier file may have damaged its memory
                    raise UnsafeFileError(
                        f"it cannot be read by the {reader} reader, which crashed or took too "
                        "long: the file is damaged or something else; export it again"
                    ) from None
            except OSError as error:  # of the mapping
                raise UnsafeFileError(
                    f"its arrays do not fit into memory ({error.strerror}): choose fewer frames"
                ) from None
            except BaseException:  # an interrupt: the next request must not get this answer
                _close()
                raise
    if "refused" in answer:
        raise UnsafeFileError(answer["refused"])
    return answer["found"]
