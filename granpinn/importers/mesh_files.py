"""The files of a mesh, an OpenFOAM case or a DaVis set, checked before a library opens them.

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
from granpinn.regular import UnsafeFileError, read_regular_file, too_large

MAX_BYTES = 2**32
MAX_FILES = 100_000
_MAX_INDEX_BYTES = 2**26  # of a file that names others
_MAX_NAMED_DEPTH = 4
_INDEXES = (".pvd", ".pvtu", ".pvti", ".pvtr", ".pvts", ".pvtp", ".vtm", ".vtmb")
_NAMED = re.compile(r"""\b(?:file|Source|fileName)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_INCLUDE = re.compile(rb"#\s*(?:include|includeIfPresent|sinclude)\s*\"?([^\"\s;]*)")
_PIECE = 2**20
_OVERLAP = 4096


def check_files(path: Path) -> int:
    """Size of all files that a mesh or case consists of.

    Raises:
        UnsafeFileError: a file is a device, a FIFO or too large, or lies elsewhere.
    """
    if path.is_dir():
        return _check_case(path)
    suffix = path.suffix.lower()
    if suffix == ".foam":
        return _check_case(path.absolute().parent)
    if suffix in _INDEXES:
        return _check_index(path, path.absolute().parent.resolve(), 0)
    return file_bytes(path)


def check_folder(folder: Path) -> int:
    """Size of all files of a folder and the folders in it; links may not lead out of it."""
    total = 0
    for count, path in enumerate(_walk(folder)):
        total += path.stat().st_size
        if count > MAX_FILES or total > MAX_BYTES:
            raise too_large(total, MAX_BYTES, "choose fewer frames or files")
    return total


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
    total = check_folder(case)
    for path in _walk(case):
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


def _check_index(path: Path, root: Path, depth: int) -> int:
    """A file of XML that names other files, which may name others."""
    content = read_regular_file(path, _MAX_INDEX_BYTES)
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text or "<!DOCTYPE" in text or "<!ENTITY" in text or "&#" in text:
        raise UnsafeFileError(
            f"{path} must be plain XML in UTF-8 without entities, got other content: export it "
            "again"
        )
    total = len(content)
    named = {match[1] or match[2] or "" for match in _NAMED.finditer(text)} - {""}
    if len(named) > MAX_FILES or depth > _MAX_NAMED_DEPTH:
        raise UnsafeFileError(f"{path} must name at most {MAX_FILES} files: choose fewer frames")
    for name in sorted(named):
        other = path.parent / name
        if Path(name).is_absolute() or not _is_inside(other, root):
            raise UnsafeFileError(
                f"{path} must name files of its folder only, got {name[:80]!r}: copy them there"
            )
        deeper = other.suffix.lower() in _INDEXES
        total += _check_index(other, root, depth + 1) if deeper else check_files(other)
        if total > MAX_BYTES:
            raise too_large(total, MAX_BYTES)
    return total
