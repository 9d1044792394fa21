"""Regular files from an unknown source: read into memory whole, never anything else than a file."""

from __future__ import annotations

import os
import stat
from pathlib import Path

RETRY = "copy or make it again"


class UnsafeFileError(ValueError):
    """A file breaks a rule of its container; the message is one sentence without the path."""


def read_regular_file(
    path: Path, max_bytes: int, remedy: str = "choose fewer frames", *, follow: bool = True
) -> bytes:
    """The content of a regular file.

    Args:
        max_bytes: largest size.
        remedy: for a larger file.
        follow: whether the path may be a symbolic link.

    Raises:
        UnsafeFileError: this is a directory, FIFO, device or socket, or the file is missing, empty
            or too large.
    """
    with_links = 0 if follow else os.O_NOFOLLOW
    try:
        # Before opening: opening a device can have effects.
        _require_regular(path.stat(follow_symlinks=follow).st_mode)
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | with_links)
        with os.fdopen(handle, "rb") as file:
            status = os.fstat(handle)
            if not stat.S_ISREG(status.st_mode):
                raise UnsafeFileError("this file was replaced while it was opened: try again")
            if status.st_size > max_bytes:
                raise too_large(status.st_size, max_bytes, remedy)
            content = file.read(status.st_size)
    except FileNotFoundError:
        raise UnsafeFileError("there is no such file: check the path") from None
    except OSError as error:
        raise UnsafeFileError(f"the file cannot be opened ({error.strerror}): check it") from None
    if not content:
        raise UnsafeFileError(f"the file is empty, expected data: {RETRY}")
    return content


def first_bytes(path: Path, count: int) -> bytes:
    """The start of a regular file, b"" of an empty one; UnsafeFileError for anything else."""
    try:
        _require_regular(path.stat().st_mode)
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            _require_regular(os.fstat(handle).st_mode)
            return file.read(count)
    except FileNotFoundError:
        raise UnsafeFileError("there is no such file: check the path") from None
    except OSError as error:
        raise UnsafeFileError(f"the file cannot be opened ({error.strerror}): check it") from None


def _require_regular(mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise UnsafeFileError("this is a directory, expected a file: name the file in it")
    if not stat.S_ISREG(mode):
        raise UnsafeFileError("this is no regular file: copy the data to one and name that")


def too_large(n_bytes: int, max_bytes: int, remedy: str = "choose fewer frames") -> UnsafeFileError:
    """The error for a file that holds or declares more than `max_bytes`."""
    return UnsafeFileError(
        f"the file must hold at most {max_bytes / 2**30:.3g} GiB of data, got "
        f"{n_bytes / 2**30:.3g} GiB: {remedy}"
    )
