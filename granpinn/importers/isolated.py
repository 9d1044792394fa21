"""Reads a file with a foreign library in a process of its own; see foreign_process.py."""

from __future__ import annotations

import atexit
import importlib.util
import io
import json
import os
import selectors
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.importers import foreign_process
from granpinn.importers.vectors import DataFileError

SECONDS = 15.0
BYTES_PER_SECOND = 2**20
START_SECONDS = 120.0  # for the imports of the library
# Memory of a reading: packed data of a valid file unpack to a few times their size.
LEAST_BYTES = 2**30
BYTES_PER_BYTE = 50
MOST_BYTES = 2**34
_LENGTH = 8


class _Crashed(Exception):
    """The process has ended, or did not answer in time."""


class _Process:
    def __init__(self, library: str) -> None:
        command = [sys.executable, "-P", foreign_process.__file__, library]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests, self._answers = self._process.stdin, self._process.stdout
        self._read(len(foreign_process.READY), time.monotonic() + START_SECONDS)

    def ask(self, request: dict[str, Any], seconds: float) -> bytes:
        """The answer to a request."""
        end = time.monotonic() + seconds
        try:
            self._requests.write(json.dumps(request).encode() + b"\n")
            self._requests.flush()
        except OSError:
            raise _Crashed from None
        length = int.from_bytes(self._read(_LENGTH, end), "little")
        if length > MOST_BYTES:
            raise _Crashed
        return self._read(length, end)

    def _read(self, length: int, end: float) -> bytes:
        content = bytearray()
        with selectors.DefaultSelector() as selector:
            selector.register(self._answers, selectors.EVENT_READ)
            while len(content) < length:
                if not selector.select(max(0.0, end - time.monotonic())):
                    raise _Crashed
                part = os.read(self._answers.fileno(), min(length - len(content), 2**20))
                if not part:
                    raise _Crashed
                content += part
        return bytes(content)

    def close(self) -> None:
        """Ends the process."""
        self._process.kill()
        self._process.communicate()


_RUNNING: dict[str, _Process] = {}


@atexit.register
def _close_all() -> None:
    while _RUNNING:
        _RUNNING.popitem()[1].close()


def installed(library: str) -> bool:
    """Whether the library can be imported."""
    return importlib.util.find_spec(library) is not None


def read_isolated(library: str, path: Path, n_bytes: int, **request: Any) -> list[dict[str, Any]]:
    """The frames that foreign_process.py gives for a file.

    Args:
        library: "pyvista" or "lvpyio".
        n_bytes: size of all files that belong to it; it limits time and memory.
        request: further values of the request.

    Raises:
        DataFileError: the library refuses the file, crashes on it, or takes too long.
    """
    limit = min(max(LEAST_BYTES, BYTES_PER_BYTE * n_bytes), MOST_BYTES)
    asked = {"path": str(path.absolute()), "max_bytes": limit, **request}
    try:
        if library not in _RUNNING:
            _RUNNING[library] = _Process(library)
        content = _RUNNING[library].ask(asked, SECONDS + n_bytes / BYTES_PER_SECOND)
        with np.load(io.BytesIO(content)) as answer:
            arrays = dict(answer)
    except _Crashed:
        if library in _RUNNING:
            _RUNNING.pop(library).close()
        raise DataFileError(
            f"{path} cannot be read by {library} (it crashed or took too long): the file is "
            "damaged or something else; export it again"
        ) from None
    meta = json.loads(arrays.pop("meta").tobytes())
    if "error" in meta:
        raise DataFileError(f"{path} cannot be read by {library} ({meta['error']}): check it")
    frames: list[dict[str, Any]] = meta["frames"]
    for key, array in arrays.items():
        index, _, name = key.partition("/")
        frames[int(index)][name] = array
    return frames
