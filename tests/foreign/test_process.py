"""The process that opens foreign files: it may crash or hang, and the next file is read."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from granpinn.foreign import process, read_foreign
from granpinn.foreign.program import Answer
from granpinn.regular import UnsafeFileError


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "a.npz"
    arrays = {"u": np.arange(6.0).reshape(2, 3), "t": np.arange(2), "none": np.empty((0, 3))}
    np.savez(path, **arrays, unit="mm")
    return path


def test_arrays_and_text_come_back(path: Path) -> None:
    found = read_foreign("npz", path, 0)
    np.testing.assert_array_equal(found["u"], np.arange(6.0).reshape(2, 3))
    assert found["t"].dtype == np.int64
    assert found["none"].shape == (0, 3)
    assert found["unit"] == "mm"
    found["u"][0] = 9  # the arrays are those of this process
    assert (read_foreign("npz", path, 0)["u"][0] == [0, 1, 2]).all()


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL])
def test_a_new_process_answers_for_one_that_does_not(
    path: Path, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    read_foreign("npz", path, 0)
    first = process._running[0].process
    monkeypatch.setattr(process, "START_SECONDS", 5.0)
    os.kill(first.pid, number)
    assert read_foreign("npz", path, 0)["u"].size == 6
    assert process._running[0].process is not first


def test_a_new_process_that_gives_no_answer(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process._close()
    monkeypatch.setattr(process, "START_SECONDS", 1e-3)
    with pytest.raises(UnsafeFileError, match="crashed or took too long"):
        read_foreign("npz", path, 0)
    monkeypatch.undo()
    assert read_foreign("npz", path, 0)["u"].size == 6


def test_an_interrupt_leaves_no_answer_behind(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("socket.recv_fds", interrupt)
    with pytest.raises(KeyboardInterrupt):
        read_foreign("npz", path, 0)
    monkeypatch.undo()
    np.savez(path, u=np.zeros(1))
    assert read_foreign("npz", path, 0).keys() == {"u"}


def _in_a_fork(path: Path) -> int:
    return int(read_foreign("npz", path, 0)["u"].size)


def test_forks_and_threads_have_their_own_answers(path: Path) -> None:
    def read(k: int) -> bool:
        np.savez(path.with_name(f"{k}.npz"), u=np.full(1000, k))
        return bool((read_foreign("npz", path.with_name(f"{k}.npz"), 0)["u"] == k).all())

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(read, range(20)))
    first = process._running[0].process
    with multiprocessing.get_context("fork").Pool(1) as forked:
        assert forked.apply(_in_a_fork, (path,)) == 6
    assert process._running[0].process is first
    assert read_foreign("npz", path, 0)["u"].size == 6


def test_the_process_ends_with_its_parent(path: Path) -> None:
    code = (
        "import os; from pathlib import Path; from granpinn.foreign import process, read_foreign; "
        f"read_foreign('npz', Path({str(path)!r}), 0); "
        "print(process._running[0].process.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    ended = Path(f"/proc/{int(done.stdout)}/status")
    for _ in range(100):
        if not ended.exists() or "zombie" in ended.read_text():
            return
        signal.sigtimedwait([], 0.05)
    pytest.fail("the reader outlives its parent")


def test_a_limit_of_the_user_stays_in_force() -> None:
    """With `ulimit -v`, nobody but root may raise the limit again."""
    words = "import resource; from granpinn.foreign import program; "
    words += "r = resource.RLIMIT_AS; resource.setrlimit(r, (2**36, 2**36)); "
    words += "program._limit_memory(2**35); assert resource.getrlimit(r) == (2**35, 2**36); "
    words += "program._limit_memory(2**37); assert resource.getrlimit(r) == (2**36, 2**36)"
    subprocess.run([sys.executable, "-c", words], check=True)


def test_an_answer_has_plain_numbers_and_a_limit() -> None:
    answer = Answer(100)
    with answer.file:
        assert answer.keep(np.zeros((2, 3), ">f4")) == {"at": 0, "dtype": ">f4", "shape": (2, 3)}
        for wrong in (np.array([None]), np.array(["a"]), np.zeros(2, "c8")):
            with pytest.raises(UnsafeFileError, match="must hold plain numbers, got an array of"):
                answer.keep(wrong)
        with pytest.raises(UnsafeFileError, match="must hold at most"):
            answer.keep(np.zeros(10))


def test_a_readers_memory_does_not_come_back(path: Path) -> None:
    """The parent maps the answer: it holds the arrays once."""
    np.savez(path, u=np.ones(2**24))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = SimpleNamespace(**read_foreign("npz", path, path.stat().st_size))
    assert found.u.sum() == 2**24
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 150_000  # kB
