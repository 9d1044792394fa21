"""The edge of every command: whatever happens inside becomes an exit code and one sentence.

    0          done
    1          cannot go on: CannotGoOn, a file or stdout that cannot be written, too little memory,
               or a bug
    2          bad input: BadInput
    129, 130, 143  stopped by SIGHUP, SIGINT, SIGTERM

This module loads only the standard library. `cli` calls `guard_process` before it imports a
command, which so catches what happens while torch and the other libraries are loaded.

With the environment variable GRANPINN_DEBUG=1 every sentence comes with its traceback.
"""

from __future__ import annotations

import errno
import gc
import io
import os
import resource
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, cast

from granpinn.errors import (
    BadInput,
    CannotGoOn,
    FlowFileWarning,
    Interrupted,
    Sentence,
    memory_sentence,
)
from granpinn.signals import Handler, handled_by, set_handler
from granpinn.terminal import say, visible

DEBUG = "GRANPINN_DEBUG"
BLAS_THREADS = "OPENBLAS_NUM_THREADS"  # read when NumPy is loaded
# The least that the libraries need, in bytes. With less they crash, or never end, while they load.
LIMITS = {"-v": (resource.RLIMIT_AS, 2**30), "-d": (resource.RLIMIT_DATA, 2**29)}
ANYWHERE = ("", "completion", "doctor")  # commands that load no large library
_guarded: list[str] = []  # the command of this process, if `guard_process` has prepared it
PACKAGE = str(Path(__file__).parents[2])


def exit_code(command: str, run: Callable[..., int], *words: Any) -> int:
    """The exit code of `run(*words)`, or that for what it raises, with one sentence on stderr.

    Inside, SIGINT, SIGTERM and SIGHUP raise Interrupted. A second signal ends the process at once.
    """
    try:
        with _interruptible(command), _warnings_in_one_line():
            code = run(*words)
    except SystemExit as stop:  # --help
        code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    except BaseException as error:
        code = fail(command, *conclusion(error), error)
    try:
        sys.stdout.flush()
    except CannotGoOn as error:
        code = code or fail(command, 1, str(error), error)
    return code


def conclusion(error: BaseException) -> tuple[int, str]:
    """Exit code and sentence for an error."""
    text = error.for_commands if isinstance(error, Sentence) else str(error)
    match error:
        case BadInput():
            return 2, text
        case CannotGoOn():
            return 1, text
        case Interrupted():
            return 128 + error.signum, text
        case KeyboardInterrupt():
            return 130, "stopped by SIGINT"
        case OSError() if error.errno == errno.ENAMETOOLONG:
            name = str(error.filename)[:60]
            return 2, f"{name}... is too long for the name of a file: choose a shorter one"
        case OSError():
            return 1, text
        case ImportError():
            return 1, f"{text}: python -m granpinn.doctor shows what is missing"
    if memory := memory_sentence(error):
        return 1, memory
    return 1, (
        f"{type(error).__name__}: {text} ({_place(error)}): this is a bug of "
        f"granpinn, please report it with the traceback that {DEBUG}=1 prints"
    )


def fail(command: str, code: int, message: str, error: BaseException | None = None) -> int:
    """Print the reason why a command failed, on one line; returns the exit code."""
    line = " ".join(f"{_program(command)}: {message}".split())
    try:
        if error is not None and os.environ.get(DEBUG):
            import traceback  # slow to import, and needed here alone

            traceback.print_exception(error)
        print(visible(line), file=sys.stderr)
    except OSError:  # nobody reads stderr
        _discard(sys.stderr.fileno())
    return code


def guard_process(command: str) -> None:
    """Prepare the process of a command, before its libraries are loaded.

    From here on a signal or an error outside of `exit_code` is one sentence too. A closed stdin,
    stdout or stderr gets a stand-in, so that no file that is opened later takes its number. NumPy
    gets one thread for its small matrices, where torch does not share its BLAS: each product would
    wait for all threads, for 8 ms where another process has one of the cores.
    """
    if os.uname().machine == "x86_64":
        os.environ.setdefault(BLAS_THREADS, "1")
    for number, mode in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, mode)  # gets the lowest free number; stdout fails if it is used
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout = _Stdout(sys.stdout)
    set_handler(_stopper(command))
    _guarded.append(command)
    sys.excepthook = lambda kind, error, place: fail(command, *conclusion(error), error)
    if command not in ANYWHERE:
        _require_memory()


def _require_memory() -> None:
    """CannotGoOn where a limit of this process leaves too little memory for the libraries."""
    for flag, (kind, need) in LIMITS.items():
        limit, _ = resource.getrlimit(kind)
        if limit != resource.RLIM_INFINITY and limit < need:
            raise CannotGoOn(
                f"this process needs at least {need // 1024} KiB of memory, ulimit {flag} allows "
                f"{limit // 1024}: raise the limit, ulimit {flag} {need // 1024}"
            )


def keep_what_is_loaded() -> None:
    """Spare the garbage collector what is loaded by now, if the process belongs to a command.

    Modules stay to the end of the process. Collections, above all those of its exit, would look
    through all of them.
    """
    if _guarded:
        gc.freeze()


@contextmanager
def _interruptible(command: str) -> Iterator[None]:
    """Inside, the first signal raises Interrupted, and a second one ends the process."""

    def interrupt(signum: int, frame: FrameType | None) -> NoReturn:
        set_handler(_stopper(command))
        raise Interrupted(signum, _stopped(signum))

    with handled_by(interrupt):
        yield


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    """Inside, a FlowFileWarning is printed without the place in the program."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", FlowFileWarning)
        shown = warnings.showwarning

        def show(message: Any, category: type[Warning], *place: Any) -> None:
            if issubclass(category, FlowFileWarning):
                say(f"warning: {message}")
            else:
                shown(message, category, *place)

        warnings.showwarning = cast(Any, show)
        yield


def _stopper(command: str) -> Handler:
    """A handler that ends the process with one sentence, in whatever code the signal arrives."""

    def stop(signum: int, frame: FrameType | None) -> NoReturn:
        with suppress(OSError):
            os.write(2, f"{_program(command)}: {_stopped(signum)}\n".encode())
        os._exit(128 + signum)

    return stop


def _program(command: str) -> str:
    return f"granpinn.{command}" if command else "granpinn"


def _stopped(signum: int) -> str:
    return f"stopped by {signal.Signals(signum).name}"


def _place(error: BaseException) -> str:
    """The last line of granpinn in the traceback of an error."""
    place, step = "outside of granpinn", error.__traceback__
    while step is not None:
        file = step.tb_frame.f_code.co_filename
        if file.startswith(PACKAGE):
            place = f"granpinn{file.removeprefix(PACKAGE)}:{step.tb_lineno}"
        step = step.tb_next
    return place


def _discard(number: int) -> None:
    """Drop what is written to a file descriptor from now on, also at the end of Python."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), number)


class _Stdout(io.TextIOWrapper):
    """The stdout of a command: visible text; where it cannot be written, CannotGoOn.

    With an OSError the fault would be taken for one of a file, and argparse would swallow it.
    """

    def __init__(self, before: io.TextIOWrapper) -> None:
        encoding, lines, through = before.encoding, before.line_buffering, before.write_through
        errors = "backslashreplace" if before.errors == "strict" else before.errors
        super().__init__(
            before.detach(), encoding, errors, line_buffering=lines, write_through=through
        )

    def write(self, text: str) -> int:
        try:
            return super().write(visible(text))
        except OSError as fault:
            raise self._failed(fault) from fault

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as fault:
            raise self._failed(fault) from fault

    def _failed(self, fault: OSError) -> CannotGoOn:
        """The sentence for a fault; later output is dropped."""
        _discard(self.fileno())
        return CannotGoOn(
            f"the output cannot be written to stdout ({fault.strerror}): give it another place; "
            "files that were written are whole"
        )
