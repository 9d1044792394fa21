"""The processes of all commands: signals at any moment, broken outputs, and errors of any class."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

import pytest

from granpinn.commands.shared import cli, exit_codes
from granpinn.commands.shared.exit_codes import exit_code
from granpinn.errors import BadInput, CannotGoOn, Interrupted

COMMANDS = [name for name in cli.VERBS if name != "completion"]

HEAVY = [name for name in COMMANDS if name != "doctor"]  # the doctor imports nothing at its start

# A module that takes the place of a library and never ends its import.
SLOW = "import os, time\nos.write(1, b'importing')\ntime.sleep(60)\n"

OUTPUTS = {
    "completion": ["completion", "--help"],
    "help": ["--help"],
    "help of a verb": ["train", "--help"],
    "inspect": ["inspect", "FLOW"],
    "version": ["--version"],
}


@pytest.fixture(autouse=True)
def handlers_like_in_a_terminal() -> Iterator[None]:
    """A shell ignores SIGINT in background jobs, and its children inherit that."""
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def as_module(name: str) -> list[str]:
    return [sys.executable, "-m", f"granpinn.{name}"]


def as_verb(name: str) -> list[str]:
    return [sys.executable, "-m", "granpinn", name]


def one_sentence(err: str, program: str) -> str:
    assert err.startswith(f"{program}: "), err
    assert err.count("\n") == 1, err
    return err


@pytest.mark.parametrize(
    ("name", "start", "signum"),
    [
        *((name, as_module, signal.SIGINT) for name in HEAVY),
        *(("train", as_verb, signum) for signum in (signal.SIGINT, signal.SIGTERM)),
    ],
)
def test_a_signal_during_the_imports_is_one_sentence(
    name: str, start: Callable[[str], list[str]], signum: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "numpy.py").write_text(SLOW)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        start(name),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert process.stdout is not None
    assert process.stdout.read(9) == b"importing"
    process.send_signal(signum)
    _, err = process.communicate(timeout=15)
    assert process.returncode == 128 + signum
    assert f"stopped by {signum.name}" in one_sentence(err.decode(), f"granpinn.{name}")


def test_a_library_that_is_broken_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "h5py.py").write_text("raise ImportError('libhdf5.so: no such file')\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        as_verb("train"), capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path}
    )
    assert done.returncode == 1
    err = one_sentence(done.stderr, "granpinn.train")
    assert "libhdf5.so: no such file" in err
    assert "granpinn.doctor" in err


@pytest.mark.parametrize(
    ("what", "unbuffered", "target"),
    [
        case
        for case in product(OUTPUTS, ["", "1"], ["/dev/full", "closed", "broken pipe"])
        # An inspection takes seconds.
        if case[0] != "inspect" or case[1:] == ("1", "broken pipe")
    ],
)
def test_a_stdout_that_cannot_be_written_is_one_sentence(
    what: str, unbuffered: str, target: str, flow_file: Path
) -> None:
    words = [str(flow_file) if word == "FLOW" else word for word in OUTPUTS[what]]
    done = with_stdout(target, words, unbuffered)
    assert done.returncode == 1
    verb = OUTPUTS[what][0]
    program = "granpinn" if verb.startswith("-") else f"granpinn.{verb}"
    assert "cannot be written to stdout (" in one_sentence(done.stderr, program)


def with_stdout(
    target: str, words: list[str], unbuffered: str = ""
) -> subprocess.CompletedProcess[str]:
    """`granpinn WORDS` with a stdout that is full, closed, or a pipe without a reader."""
    env = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    argv = [sys.executable, "-m", "granpinn", *words]
    if target == "broken pipe":
        reader, writer = os.pipe()
        os.close(reader)
        try:
            return subprocess.run(argv, stdout=writer, stderr=subprocess.PIPE, text=True, env=env)
        finally:
            os.close(writer)
    line = '"$@" >&-' if target == "closed" else f'"$@" >{target}'
    return subprocess.run(
        ["bash", "-c", line, "bash", *argv], stderr=subprocess.PIPE, text=True, env=env
    )


@pytest.mark.parametrize(
    ("name", "flag", "kibibytes"),
    [
        *((name, "-v", 600_000) for name in HEAVY),
        ("train", "-v", 500_000),
        ("train", "-d", 200_000),
    ],
)
def test_too_little_memory_for_the_libraries_is_one_sentence(
    name: str, flag: str, kibibytes: int
) -> None:
    """The libraries crash with less, or never end."""
    line = f'ulimit {flag} {kibibytes}; exec "$@"'
    words = ["bash", "-c", line, "bash", *as_module(name), "--help"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    message = one_sentence(done.stderr, f"granpinn.{name}")
    assert f"ulimit {flag} allows {kibibytes}: raise the limit" in message


# ---- the boundary in this process ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (BadInput("cells must be even, got 3: take 4"), 2, "cells must be even, got 3: take 4"),
        (CannotGoOn("the solve\nstopped"), 1, "the solve stopped"),
        (OSError(28, "No space left on device", "run/fields.h5"), 1, "run/fields.h5"),
        (MemoryError("Unable to allocate 31 GiB"), 1, "not enough memory (Unable to allocate"),
        (Interrupted(15, "stopped at step 7"), 143, "stopped at step 7"),
        (KeyboardInterrupt(), 130, "stopped by SIGINT"),
        (
            RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 GB"),
            1,
            "there is not enough memory (DefaultCPUAllocator",
        ),
        (ImportError("no module named scipy"), 1, "granpinn.doctor shows what is missing"),
        (ZeroDivisionError("division by zero"), 1, "ZeroDivisionError: division by zero"),
        (RecursionError(), 1, "this is a bug of granpinn"),
        (BadInput("the unit \x1b[31m is unknown\x07"), 2, "the unit \\x1b[31m is unknown\\x07"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_every_error_is_one_sentence(
    error: BaseException, code: int, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def run() -> int:
        raise error

    assert exit_code("verb", run) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert text in one_sentence(err, "granpinn.verb")


def test_a_bug_names_its_place_and_shows_its_traceback_on_demand(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "FIRST_STEPS", 1 / 3)
    monkeypatch.setattr(cli, "PURPOSE", None)
    assert cli.main(["--help"]) == 1
    err = one_sentence(capsys.readouterr().err, "granpinn")
    assert "TypeError: " in err
    assert "(granpinn/commands/shared/cli.py:" in err
    assert "GRANPINN_DEBUG=1" in err
    monkeypatch.setenv("GRANPINN_DEBUG", "1")
    assert cli.main(["--help"]) == 1
    assert capsys.readouterr().err.startswith("Traceback (most recent call last)")


def test_signals_interrupt_the_run_and_handlers_are_put_back() -> None:
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    for signum in (signal.SIGINT, signal.SIGTERM):
        assert exit_code("verb", lambda s=signum: signal.raise_signal(s)) == 128 + signum
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before


def test_outside_the_main_thread_a_command_runs_without_handlers() -> None:
    codes: list[int] = []
    thread = threading.Thread(target=lambda: codes.append(exit_code("verb", lambda: 3)))
    thread.start()
    thread.join()
    assert codes == [3]


def test_a_second_signal_ends_the_process_at_once() -> None:
    code = (
        "import os, signal, sys, time\n"
        "from granpinn.commands.shared.exit_codes import exit_code\n"
        "def run():\n"
        "    try:\n"
        "        signal.raise_signal(signal.SIGTERM)\n"
        "    finally:\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "        time.sleep(60)\n"
        "sys.exit(exit_code('verb', run))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=15)
    assert done.returncode == 130
    assert one_sentence(done.stderr, "granpinn.verb")


def test_importing_the_boundary_changes_no_handler_and_loads_no_library() -> None:
    code = (
        "import signal, sys\n"
        "before = [signal.getsignal(n) for n in (2, 15)], sys.excepthook\n"
        "import granpinn.commands.shared.exit_codes\n"
        "assert before == ([signal.getsignal(n) for n in (2, 15)], sys.excepthook)\n"
        "assert not {'torch', 'numpy', 'h5py'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert exit_codes.DEBUG == "GRANPINN_DEBUG"
