"""Regular files from an unknown source: read into memory whole; never anything else."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

RETRY = "copy or make it again"
MAX_TEXT = 2**28  # bytes of a text that granpinn wrote, such as results.json


class UnsafeFileError(ValueError):
    """A file breaks a rule of its container; the message is one sentence without the path."""


class MissingFileError(UnsafeFileError, FileNotFoundError):
    """There is no such file."""


def open_regular_file(path: Path, max_bytes: int, remedy: str = "choose fewer frames") -> BinaryIO:
    """Opens a regular file with data for reading.

    Args:
        max_bytes: largest size.
        remedy: for a larger file.

    Raises:
        UnsafeFileError: this is a directory, FIFO, device or socket, or the file is missing, empty
            or too large.
    """
    stream = _opened(path)
    size = os.fstat(stream.fileno()).st_size
    if 0 < size <= max_bytes:
        return stream
    stream.close()
    if size:
        raise too_large(size, max_bytes, remedy)
    raise UnsafeFileError(f"the file is empty, expected data: {RETRY}")


def read_regular_file(path: Path, max_bytes: int, remedy: str = "choose fewer frames") -> bytes:
    """The content of a regular file; arguments and errors as for `open_regular_file`."""
    with open_regular_file(path, max_bytes, remedy) as file:
        return _read(file, os.fstat(file.fileno()).st_size)


def read_text(path: Path, max_bytes: int = MAX_TEXT) -> str:
    """The text of a regular file in UTF-8, which may be empty.

    Raises:
        UnsafeFileError: as for `open_regular_file`.
        UnicodeDecodeError: other bytes.
    """
    with _opened(path) as file:
        if (size := os.fstat(file.fileno()).st_size) > max_bytes:
            raise too_large(size, max_bytes, "it holds something else than it should")
        return _read(file, max_bytes).decode()


def first_bytes(path: Path, count: int) -> bytes:
    """The start of a regular file, b"" of an empty one; UnsafeFileError for anything else."""
    with _opened(path) as file:
        return _read(file, count)


def _opened(path: Path) -> BinaryIO:
    """A regular file; never waits, as the open of a FIFO would."""
    try:
        # Before opening: opening a device can have effects.
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise UnsafeFileError("this is a directory, expected a file: name the file in it")
        if not stat.S_ISREG(mode):
            raise UnsafeFileError("this is no regular file: copy the data to one and name that")
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except UnsafeFileError:
        raise
    except FileNotFoundError:
        raise MissingFileError("there is no such file: check the path") from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the path
        reason = error.strerror if isinstance(error, OSError) else error
        raise UnsafeFileError(f"the file cannot be opened ({reason}): check it") from None
    stream = os.fdopen(handle, "rb")
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        stream.close()
        raise UnsafeFileError("this file was replaced while it was opened: try again")
    return stream


def _read(file: BinaryIO, count: int) -> bytes:
    try:
        return file.read(count)
    except OSError as error:
        raise UnsafeFileError(f"the file cannot be read ({error.strerror}): check it") from None


def too_large(n_bytes: int, max_bytes: int, remedy: str = "choose fewer frames") -> UnsafeFileError:
    """The error for a file that holds or declares more than `max_bytes`."""
    return UnsafeFileError(
        f"the file must hold at most {max_bytes / 2**30:.3g} GiB of data, got "
        f"{n_bytes / 2**30:.3g} GiB: {remedy}"
    )
