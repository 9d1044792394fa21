"""Replaces a file in one step: a crash or a full disk leaves the old content or the new."""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from granpinn.output.targets import failure, require_file


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path` to write to.

    On success its content is flushed to disk, it replaces `path`, and the folder is flushed; on
    failure it is removed and `path` is as it was. A process holds a lock on its temporary file,
    so files that a killed process left behind are removed when `path` is next written.

    Raises:
        OutputError: `path` is no regular file, or the system cannot write to it.
    """
    path = require_file(path)
    with naming(path):
        _remove_abandoned(path)
        temporary, handle = _open_temporary(path)
        try:
            yield temporary
            _flush(temporary)
            temporary.replace(path)
            _flush(path.parent)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
            os.close(handle)


def write_bytes(path: str | os.PathLike[str], content: bytes | memoryview) -> None:
    """Replace a file by `content`; OutputError if it cannot be."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Replace a file by text in UTF-8; what is no text (a file name may hold it) becomes "?"."""
    write_bytes(path, text.encode(errors="replace"))


@contextmanager
def naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn failures of the system into an OutputError that names `path`."""
    try:
        yield
    except OSError as error:
        raise failure(path, error) from error


def _open_temporary(path: Path) -> tuple[Path, int]:
    """A new temporary file beside `path`, and a handle that holds its lock."""
    # Permissions as for any new file, which the umask restricts (tempfile would make them 0o600).
    temporary = path.with_name(f"{_prefix(path)}{secrets.token_hex(4)}.tmp")
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    with contextlib.suppress(OSError):  # a file system without locks: nothing is removed there
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return temporary, handle


def _prefix(path: Path) -> str:
    """Begin of the names of temporary files of `path`, short enough for any file system."""
    return f".{os.fsdecode(os.fsencode(path.name)[:200])}."


def _remove_abandoned(path: Path) -> None:
    """Remove the temporary files of `path` that no living process holds."""
    prefix = _prefix(path)
    with os.scandir(path.parent) as entries:
        names = [e.name for e in entries if e.name.startswith(prefix) and e.name.endswith(".tmp")]
    for place in map(path.with_name, names):
        with contextlib.suppress(OSError):
            handle = os.open(place, os.O_WRONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                place.unlink()
            finally:
                os.close(handle)


def _flush(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
