"""One process at a time writes to a run folder."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import granpinn
from granpinn.config import Config
from granpinn.output import OutputError, owned
from granpinn.output.ownership import LOCK
from tests.flows import make_flow
from tests.output.test_writing import TARGETS, hostile
from tests.runs import TINY

HOLD = """
import sys
from granpinn.output import owned
with owned(sys.argv[1]):
    print("owned", flush=True)
    sys.stdin.read()
"""


def holder(folder: Path) -> subprocess.Popen[str]:
    """A process that owns a folder until its input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "owned\n"
    return process


def test_a_second_process_is_refused_and_told_who_owns_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with holder(folder) as process:
        with pytest.raises(OutputError, match=f"{folder} is in use by process {process.pid} on"):
            owned(folder).__enter__()
        process.kill()
    with owned(folder):  # the lock ends with its process, also when it is killed
        pass


def test_a_thread_may_own_a_folder_twice_and_another_may_not(tmp_path: Path) -> None:
    refused = []

    def other() -> None:
        try:
            owned(tmp_path).__enter__()
        except OutputError as error:
            refused.append(str(error))

    with owned(tmp_path), owned(tmp_path / "."):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert "another thread" in refused[0]
    with owned(tmp_path):
        pass


@pytest.mark.parametrize("resume", [False, True])
def test_identifications_in_python_own_their_run_folder(tmp_path: Path, resume: bool) -> None:
    flow, config, folder = make_flow(), Config(**TINY, resume=resume), tmp_path / "run"
    with holder(folder) as process:
        for identify, subject in ((granpinn.identify, flow), (granpinn.identify_many, [flow])):
            with pytest.raises(OutputError, match=f"in use by process {process.pid} on"):
                identify(subject, config, run_dir=folder)
        assert [path.name for path in folder.iterdir()] == [LOCK]
        process.kill()


@pytest.mark.parametrize("kind", TARGETS[1:])
@pytest.mark.parametrize("inside", [False, True])
def test_a_run_folder_is_a_plain_folder_of_plain_files(
    kind: str, inside: bool, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    if inside:
        folder.mkdir()
    hostile(kind, folder / "fields.h5" if inside else folder)
    with pytest.raises(OutputError, match="must hold plain files" if inside else "must be a new"):
        owned(folder).__enter__()


def test_a_new_folder_that_stays_empty_is_removed(tmp_path: Path) -> None:
    with owned(tmp_path / "new"):
        pass
    assert not (tmp_path / "new").exists()
    (tmp_path / "old").mkdir()
    with owned(tmp_path / "old"):
        pass
    assert (tmp_path / "old").exists()
    with owned(tmp_path / "used") as folder:
        (folder / "results.json").write_text("{}")
    assert (tmp_path / "used" / "results.json").exists()


def test_a_file_in_place_of_the_folder_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run"
    path.write_text("mine")
    with pytest.raises(OutputError, match="must be a new or existing folder, got a file"):
        owned(path).__enter__()
    with pytest.raises(OutputError, match=f"{path / 'deeper'} could not be written"):
        owned(path / "deeper").__enter__()
    assert path.read_text() == "mine"


def test_a_folder_without_permission_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "mkdir", refuse)  # root may write everywhere
    with pytest.raises(OutputError, match="choose a place that you may write to"):
        owned(tmp_path / "run").__enter__()


def test_the_lock_says_nothing_of_the_machine_once_it_is_released(tmp_path: Path) -> None:
    with owned(tmp_path / "run") as folder:
        (folder / "result").write_text("kept")
        assert str(os.getpid()) in (folder / ".lock").read_text()
    assert (tmp_path / "run" / ".lock").read_text() == ""
