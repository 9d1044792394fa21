"""A run folder has one owner: the process that writes to it."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from granpinn.output.targets import OutputError, failure, make_folder, require_plain

LOCK = ".lock"  # it stays in the folder; the system releases the lock when its process ends
_WITHOUT_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS)

_owners: dict[Path, int] = {}  # folder -> thread of this process that owns it
_guard = threading.Lock()


@contextmanager
def owned(folder: str | os.PathLike[str] | None) -> Iterator[Path | None]:
    """Make a folder and keep other processes from writing to it; a thread may own it repeatedly.

    A folder that this made, and that nothing was written to, is removed at the end. None: there is
    no folder to own.

    Raises:
        OutputError: another process or thread owns the folder, it cannot be made, or it holds a
            link, a FIFO or a device, which no file of a run may replace.
    """
    if folder is None:
        yield None
        return
    made = not Path(folder).exists()
    folder = make_folder(folder)
    require_plain(folder)
    place, me = folder.resolve(), threading.get_ident()
    with _guard:
        owner = _owners.get(place)
        if owner is None:
            handle = _lock(folder)
            _owners[place] = me
    if owner == me:
        yield folder
        return
    if owner is not None:
        raise _taken(folder, "another thread of this process")
    try:
        yield folder
    finally:
        with _guard:
            del _owners[place]
            if made:
                _remove_if_empty(folder)
            with contextlib.suppress(OSError):  # nobody owns it now
                os.ftruncate(handle, 0)
            os.close(handle)


def _lock(folder: Path) -> int:
    """A handle that holds the lock of a folder until it is closed."""
    try:
        handle = os.open(
            folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666
        )
    except OSError as error:
        raise failure(folder, error) from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _WITHOUT_LOCKS:  # some network file systems
            return handle
        who = os.pread(handle, 200, 0).decode(errors="replace").strip() or "another process"
        os.close(handle)
        raise _taken(folder, who) from None
    with contextlib.suppress(OSError):  # the words are for people; a full disk may lack the room
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"process {os.getpid()} on {os.uname().nodename}\n".encode(), 0)
    return handle


def _remove_if_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):
        if [entry.name for entry in folder.iterdir()] == [LOCK]:
            (folder / LOCK).unlink()
            folder.rmdir()


def _taken(folder: Path, who: str) -> OutputError:
    return OutputError(
        f"{folder} is in use by {who}: wait until it has ended, or choose another folder"
    )
