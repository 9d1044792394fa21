"""A file is replaced whole or not at all, whatever fails on the way."""

from __future__ import annotations

import errno
import os
import pathlib
import re
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from granpinn.output import OutputError, hdf5_file, replacing, write_bytes, write_text

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

TARGETS = ["folder", "link", "dangling link", "FIFO", "socket", "device"]


def fail_at(real: Callable[..., Any], call: int) -> Callable[..., Any]:
    """`real`, but its call number `call` (from 1) raises: no space left."""
    calls = 0

    def faulty(*args: Any, **kwargs: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == call:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(*args, **kwargs)

    return faulty


def hostile(kind: str, path: Path) -> None:
    """Put something at `path` that no file may replace."""
    if kind == "folder":
        path.mkdir()
    elif "link" in kind:
        goal = path.with_name("goal")
        if kind == "link":
            goal.write_text("old")
        path.symlink_to(goal)
    elif kind == "FIFO":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    else:
        try:
            os.mknod(path, 0o20666, os.makedev(1, 3))
        except PermissionError:  # only root makes devices
            path.symlink_to("/dev/null")


@pytest.mark.parametrize("old", [None, "old"])
def test_the_new_content_is_there_and_nothing_else(old: str | None, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    if old is not None:
        path.write_text(old)
    write_text(path, "new")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_content_stays_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    with replacing(str(path)) as temporary:
        temporary.write_text("new")
        assert temporary.parent == tmp_path  # the same file system: a rename, not a copy
        assert path.read_text() == "old"
    assert path.read_text() == "new"


def test_an_error_of_the_writer_leaves_the_old_content(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    with pytest.raises(TypeError, match="must be str"), replacing(path) as temporary:
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
    sentence = f"{re.escape(str(path))} could not be written .*No space left on device.*: make room"
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, fail_at(getattr(owner, name), call))
        with pytest.raises(OutputError, match=sentence), replacing(path) as temporary:
            temporary.write_text("new")
    assert path.read_text() == expected
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("kind", TARGETS)
def test_only_regular_files_are_replaced(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "out"
    hostile(kind, path)
    before = path.lstat()
    with pytest.raises(OutputError, match=f"{path} must be a new file or a regular one, got a"):
        write_bytes(path, b"new")
    after = path.lstat()
    assert (after.st_ino, after.st_mode, after.st_rdev) == (
        before.st_ino,
        before.st_mode,
        before.st_rdev,
    )
    assert "new" not in [p.read_text() for p in tmp_path.iterdir() if p.is_file()]


def test_files_of_a_killed_writer_are_removed_and_those_of_a_living_one_stay(
    tmp_path: Path,
) -> None:
    path = tmp_path / "file"
    code = (
        "import os, sys\nfrom granpinn.output import replacing\n"
        "with replacing(sys.argv[1]) as temporary:\n    os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=False)
    (abandoned,) = tmp_path.iterdir()
    with replacing(path) as living:
        assert not abandoned.exists()
        write_text(path, "second")
        assert living.exists()
        living.write_text("first")
    assert path.read_text() == "first"
    assert list(tmp_path.iterdir()) == [path]


LIMIT = """
import resource, signal, sys
import numpy as np
from granpinn.output import OutputError, hdf5_file
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
values = np.random.default_rng(1).normal(size=(20, 30, 40))
try:
    with hdf5_file(sys.argv[1]) as file:
        for name in "uvw":
            data = file.create_dataset(
                name, values.shape, "f8", chunks=(1, 30, 40), compression="gzip", shuffle=True
            )
            file[name].attrs["units"] = "m/s"
            for k in range(20):
                data[k] = values[k]
except OutputError as error:
    print(error)
    sys.exit(1)
"""


@pytest.mark.parametrize("limit", [0, 500, 4096, 50_000, 300_000, 520_000])
def test_a_disk_that_gets_full_ends_hdf5_with_one_sentence(limit: int, tmp_path: Path) -> None:
    path = tmp_path / "fields.h5"
    path.write_bytes(b"old")
    done = subprocess.run(
        [sys.executable, "-c", LIMIT, str(path), str(limit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    assert not done.stderr
    assert done.stdout == f"{path} could not be written (File too large): make room or choose " \
        "another place\n"  # fmt: skip
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_is_not_complete_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(b"old")

    def broken() -> None:
        with hdf5_file(path) as file:
            file["v"] = 2
            raise RuntimeError

    with pytest.raises(RuntimeError):
        broken()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
