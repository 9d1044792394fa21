"""The process that opens foreign files: a program that answers requests until its input ends.

A request is one line of JSON. The answer to it is one byte, once the library is imported, and then
the place of its JSON in a file in memory, which also holds the arrays, and that file itself.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import socket
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.errors import BadInput
from granpinn.regular import UnsafeFileError, too_large

LEAST_MEMORY = 2**28  # bytes for one request
_PLAIN = "fiub"  # kinds of arrays


class Answer:
    """A file in memory that takes arrays one after another.

    Args:
        max_bytes: of all arrays.
    """

    def __init__(self, max_bytes: int) -> None:
        self.file = os.fdopen(os.memfd_create("answer"), "wb")
        self._max_bytes = max_bytes

    def require(self, n_bytes: int, remedy: str = "choose fewer frames") -> None:
        """UnsafeFileError if arrays of so many bytes are too large."""
        if n_bytes > self._max_bytes:
            raise too_large(n_bytes, self._max_bytes, remedy)

    def keep(self, values: Any) -> dict[str, Any]:
        """Writes an array of numbers, and gives what stands for it in JSON."""
        array = np.ascontiguousarray(values).reshape(np.shape(values))
        self.require(self.file.tell() + array.nbytes)
        if array.dtype.kind not in _PLAIN:
            raise UnsafeFileError(f"it must hold plain numbers, got an array of {array.dtype}")
        self.file.write(bytes(-self.file.tell() % 8))
        at = self.file.tell()
        self.file.write(array.reshape(-1).view(np.uint8).data)
        return {"at": at, "dtype": array.dtype.str, "shape": array.shape}


def main() -> None:
    """Answers requests."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))  # the answer is in memory
    with socket.socket(fileno=0) as channel, channel.makefile("r") as requests:
        for line in requests:
            request = json.loads(line)
            _limit_memory(sys.maxsize)  # imports may take more than the last request
            module = import_module(f"granpinn.foreign.{request.pop('reader')}")
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            channel.sendall(b"r")
            signal.setitimer(signal.ITIMER_PROF, request.pop("seconds"))  # its signal is fatal
            answer = Answer(request["max_bytes"])
            _limit_memory(used + max(request.pop("max_bytes"), LEAST_MEMORY))
            with answer.file as file:
                text = json.dumps(_answered(module, request, answer)).encode()
                header = b"".join(n.to_bytes(8, "little") for n in (file.tell(), len(text)))
                file.write(text)
                file.flush()
                signal.setitimer(signal.ITIMER_PROF, 0)
                socket.send_fds(channel, [header], [file.fileno()])


def _answered(module: Any, request: dict[str, Any], answer: Answer) -> dict[str, Any]:
    try:
        return {"found": module.read(Path(request.pop("path")), answer, **request)}
    except (UnsafeFileError, BadInput) as error:
        return {"refused": str(error)}
    except MemoryError:
        limit = resource.getrlimit(resource.RLIMIT_AS)[0] / 2**30
        return {
            "refused": f"its arrays need more than {limit:.3g} GiB of memory, expected less in a "
            "file of its size: choose fewer frames, or write it again without compression"
        }
    except Exception as error:  # of any kind: the library is foreign
        reason = " ".join(f"{error}".split())[:160] or type(error).__name__
        sentence = (
            f"it cannot be read by {module.LIBRARY} ({reason}): it is damaged or something else"
        )
        return {"refused": sentence}


def _limit_memory(size: int) -> None:
    """Limit the address space to `size` bytes; a limit of the user (`ulimit -v`) stays in force."""
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    limit = size if most == resource.RLIM_INFINITY else min(size, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit, most))


if __name__ == "__main__":
    main()
