"""What a command may write to: new or regular files in plain folders, nothing else.

Replacing a device, a FIFO or a symbolic link would destroy it, and a link can lead anywhere.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from granpinn.errors import CannotGoOn

_KINDS: dict[int | None, str] = {
    stat.S_IFREG: "a file",
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a symbolic link",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
_ADVICE = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "make room or choose another place"),
    **dict.fromkeys(
        (errno.EACCES, errno.EPERM, errno.EROFS), "choose a place that you may write to"
    ),
    **dict.fromkeys((errno.ENOENT, errno.ENOTDIR), "make the folder or choose another one"),
    errno.ENAMETOOLONG: "choose a shorter name",
}


class OutputError(CannotGoOn, OSError):
    """A file or folder cannot be written; the message is one sentence with its path.

    Attributes:
        reason: the words of the system, such as "No space left on device".
    """

    def __init__(self, sentence: str, reason: str = "") -> None:
        super().__init__(sentence)
        self.reason = reason or sentence


def failure(path: str | os.PathLike[str], error: OSError) -> OutputError:
    """The sentence for a failure of the system while `path` was written."""
    if isinstance(error, OutputError):
        return error
    advice = _ADVICE.get(error.errno or 0, "check the disk")
    reason = error.strerror or str(error)
    return OutputError(f"{os.fspath(path)} could not be written ({reason}): {advice}", reason)


def require_file(path: str | os.PathLike[str]) -> Path:
    """Refuse a path at which no file may be written: OutputError."""
    path = Path(path)
    kind = _kind(path)
    if kind not in (None, stat.S_IFREG):
        raise OutputError(
            f"{path} must be a new file or a regular one, got {_KINDS.get(kind, 'no regular file')}"
            ": choose another name"
        )
    if _kind(path.parent, follow=True) != stat.S_IFDIR:
        raise OutputError(
            f"{path} must lie in an existing folder: make {path.parent} or choose another one"
        )
    return path


def require_plain(folder: Path) -> None:
    """Refuse a folder that holds a link, a FIFO or a device: OutputError."""
    for place in sorted(folder.iterdir()):
        kind = _kind(place)
        if kind not in (None, stat.S_IFREG, stat.S_IFDIR):
            found = _KINDS.get(kind, "no regular file")
            raise OutputError(
                f"{folder} must hold plain files and folders, got {found}: remove {place}"
            )


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder with those above it, unless it is there; OutputError if it cannot be."""
    path = Path(path)
    kind = _kind(path)
    if kind not in (None, stat.S_IFDIR):
        raise OutputError(
            f"{path} must be a new or existing folder, got {_KINDS.get(kind, 'no folder')}: choose "
            "another name"
        )
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise failure(path, error) from error
    return path


def _kind(path: Path, follow: bool = False) -> int | None:
    """The type of a file, or of what a link leads to; None: there is none."""
    try:
        return stat.S_IFMT(path.stat(follow_symlinks=follow).st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:  # a folder that may not be read, a name that is too long
        raise failure(path, error) from error
