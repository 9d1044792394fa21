"""The files of a mesh or an OpenFOAM case, checked before a library opens them.

They must be regular files below the folder that the user named, of a bounded size.
"""

from __future__ import annotations

import gzip
import os
import re
import stat
import zlib
from collections.abc import Iterator
from pathlib import Path

from granpinn.importers.limits import file_bytes
from granpinn.regular import UnsafeFileError, too_large

MAX_BYTES = 2**32
MAX_FILES = 100_000
SUFFIXES = (".vtk", ".vti", ".vtr", ".vts", ".vtu", ".vtp")  # of meshes that name no other files
_INCLUDE = re.compile(rb"#\s*(?:include|includeIfPresent|sinclude)\s*\"?([^\"\s;]*)")
_PIECE = 2**20
_OVERLAP = 4096


def check_files(path: Path) -> int:
    """Size of all files that a mesh or case consists of.

    Raises:
        UnsafeFileError: a file is a device, a FIFO or too large, lies elsewhere, or may name
            others.
    """
    if path.is_dir():
        return _check_case(path)
    if path.suffix.lower() not in SUFFIXES:
        raise UnsafeFileError(
            f"a mesh must be a file named {', '.join(SUFFIXES)}, as others may name files "
            "elsewhere: give the files of its frames, and their --times"
        )
    return file_bytes(path)


def _walk(folder: Path) -> Iterator[Path]:
    root = folder.resolve()
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(place, name)
            if path.is_symlink() and not _is_inside(path, root):
                raise UnsafeFileError(f"{path} is a link out of the folder: copy the file")
            if path.is_dir():
                continue
            if not path.exists() or not stat.S_ISREG(path.stat().st_mode):
                raise UnsafeFileError(f"{path} must be a regular file: remove it")
            yield path


def _is_inside(path: Path, root: Path) -> bool:
    """Whether a path leads to a place in a folder; a link to itself leads nowhere."""
    try:
        return path.resolve().is_relative_to(root)
    except RuntimeError:
        return False


def _check_case(case: Path) -> int:
    """An OpenFOAM case: its dictionaries may include files of the case only."""
    total = 0
    for count, path in enumerate(_walk(case)):
        total += path.stat().st_size
        if count > MAX_FILES or total > MAX_BYTES:
            raise too_large(total, MAX_BYTES, "choose fewer frames or files")
        for name in _included(path):
            if name.startswith(("/", "~", "$", "<")) or ".." in Path(name).parts:
                raise UnsafeFileError(
                    f"{path} must include files of its folder only, got {name[:80]!r}: copy the "
                    "file into the case"
                )
    return total


def _included(path: Path) -> Iterator[str]:
    """Names after #include in a file, also in a packed one."""
    packed = path.suffix == ".gz"
    try:
        with gzip.open(path, "rb") if packed else path.open("rb") as stream:
            before, total = b"", 0
            while piece := stream.read(_PIECE):
                total += len(piece)
                if total > MAX_BYTES:
                    raise too_large(total, MAX_BYTES)
                if b"#" in piece or b"#" in before:
                    for found in _INCLUDE.finditer(before + piece):
                        yield found[1].decode("utf-8", "replace")
                before = piece[-_OVERLAP:]
    except (OSError, EOFError, zlib.error):
        raise UnsafeFileError(f"{path} cannot be read, it is damaged: copy it again") from None
