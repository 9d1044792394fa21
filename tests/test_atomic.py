"""A file is replaced whole or not at all, whatever fails on the way."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from granpinn.atomic import atomic_path

# What may fail, at which of its calls, and what the file holds then. The first flush is of the
# file, the second of its folder: by then the new content is in place.
FAULTS = [
    (os, "open", 1, "old"),
    (os, "fsync", 1, "old"),
    (pathlib.Path, "replace", 1, "old"),
    (os, "open", 2, "old"),
    (os, "open", 3, "new"),
    (os, "fsync", 2, "new"),
]


def fail_at(real: Callable[..., Any], call: int) -> Callable[..., Any]:
    """`real`, but its call number `call` (from 1) raises: no space left."""
    calls = 0

    def faulty(*args: Any, **kwargs: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == call:
            raise OSError(28, "No space left on device")
        return real(*args, **kwargs)

    return faulty


def write(path: Path, text: str) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(text)


@pytest.mark.parametrize("old", [None, "old"])
def test_the_new_content_is_there_and_nothing_else(old: str | None, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    if old is not None:
        path.write_text(old)
    write(path, "new")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_content_stays_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    with atomic_path(str(path)) as temporary:
        temporary.write_text("new")
        assert temporary.parent == tmp_path  # the same file system: a rename, not a copy
        assert path.read_text() == "old"
    assert path.read_text() == "new"


def test_an_error_of_the_writer_leaves_the_old_content(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    with pytest.raises(TypeError, match="must be str"), atomic_path(path) as temporary:
        temporary.write_text(b"new")  # type: ignore[arg-type]
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("owner", "name", "call", "expected"), FAULTS, ids=[f"{f[1]}-{f[2]}" for f in FAULTS]
)
def test_a_fault_of_the_system_leaves_the_old_content_or_the_new(
    owner: Any, name: str, call: int, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, fail_at(getattr(owner, name), call))
        with pytest.raises(OSError, match="No space left on device"):
            write(path, "new")
    assert path.read_text() == expected
    assert list(tmp_path.iterdir()) == [path]


def test_the_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write(tmp_path / "file", "new")
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o640


def test_a_missing_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write(tmp_path / "missing" / "file", "new")
    assert not list(tmp_path.iterdir())
