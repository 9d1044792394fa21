"""Sizes and memory of all readers: what a file declares is checked before memory is taken for it.

Readers count values before they convert them, because the conversion to float64 multiplies the size
of small types: a compressed file of a few megabytes can declare many gigabytes.
"""

from __future__ import annotations

import os
import resource
import stat
from pathlib import Path
from typing import BinaryIO

from granpinn.importers.vectors import DataFileError

# Of the arrays of one flow, as float64.
MAX_BYTES = 2**33
# The arrays of the files, those in SI units, and those of the flow exist at the same time: of u and
# v with their validity 94 bytes a vector at the peak, of scattered vectors 196 for t, x, y, u, v.
COPIES = 6
_GIB = 2**30


def require_room(values: int, bytes_per_value: float, path: Path | str) -> None:
    """Checks that values can be converted to a flow.

    Args:
        values: how many numbers there will be, such as T * Y * X times the number of arrays.
        bytes_per_value: of one number after the conversion, 8 for float64.
        path: of the file, for the message.

    Raises:
        DataFileError: the arrays would be larger than `MAX_BYTES`, or than the free memory with
            the copies of a conversion.
    """
    size = values * bytes_per_value
    if size > MAX_BYTES:
        raise DataFileError(
            f"{path} must hold at most {MAX_BYTES / _GIB:.3g} GiB of numbers, got {values} numbers "
            f"or {size / _GIB:.3g} GiB: use fewer frames or a part of the field"
        )
    free = available()
    if COPIES * size > free:
        raise DataFileError(
            f"{path} holds {values} numbers, whose conversion needs {COPIES * size / _GIB:.3g} GiB "
            f"of memory, got {free / _GIB:.3g} GiB: use fewer frames or a larger machine"
        )


def available() -> int:
    """Bytes of memory that this process may still take."""
    free = _free_memory()
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft != resource.RLIM_INFINITY:
        free = min(free, soft - _address_space())
    return max(free, 0)


def _free_memory() -> int:
    """Free memory of the machine, and what the kernel can give back."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        fields = dict(line.split(":", 1) for line in lines)
        return int(fields["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):  # not Linux, or hidden in a container
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _address_space() -> int:
    """Bytes of address space that this process has."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def open_file(path: Path, max_bytes: int) -> BinaryIO:
    """Opens a regular file for reading; never waits, as the open of a FIFO would.

    Raises:
        DataFileError: it cannot be opened, is no regular file, is empty, or too large.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the path
        reason = error.strerror if isinstance(error, OSError) else error
        raise DataFileError(f"{path} cannot be opened ({reason}): check it") from None
    stream = os.fdopen(handle, "rb")
    found = os.fstat(handle)
    problem = ""
    if not stat.S_ISREG(found.st_mode):
        problem = "must be a file with data, got a folder, a device or a pipe: check the path"
    elif found.st_size == 0:
        problem = "is empty, expected vectors: export it again"
    elif found.st_size > max_bytes:
        problem = (
            f"must hold at most {max_bytes / _GIB:.3g} GiB, got {found.st_size / _GIB:.3g} GiB: "
            "split it into one file per frame"
        )
    if problem:
        stream.close()
        raise DataFileError(f"{path} {problem}")
    return stream
