"""One command in a process of its own: limits, captured output, files that it opens.

The process is a fork of one that has imported everything, so that it starts in milliseconds.
"""

from __future__ import annotations

import contextlib
import os
import resource
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SECONDS = 15  # of processor time: the machine may be busy with other things
WAITING = 60.0  # wall time, for a command that blocks
ADDRESS_SPACE = 3 * 2**30  # bytes above what is in use at the start
OUTPUT = 200_000  # characters that are kept
STARTED = ("subprocess.Popen", "os.exec", "os.fork", "os.posix_spawn", "os.system", "socket.")
LOG = 199  # descriptor of the report, which nothing else uses
ESCAPED = 70  # exit code of an exception that no command caught
PREPARATION = 71  # exit code if the input could not be made


@dataclass
class Outcome:
    """How a command ended.

    Attributes:
        code: its exit code; negative: the signal that ended it; None: it took too long.
        seconds: of the processor.
        output, errors: what it printed.
        opened: paths that it opened, in its own words.
        started: processes and connections that it started, as the interpreter names them.
        memory: largest resident memory above that at the start, in bytes.
    """

    code: int | None
    seconds: float
    output: str = ""
    errors: str = ""
    opened: set[str] = field(default_factory=set)
    started: set[str] = field(default_factory=set)
    memory: int = 0

    @property
    def broken(self) -> str | None:
        """How the command broke: hang, crash or traceback; None where it ended by itself."""
        if self.code is None:
            return "hang"
        if self.code < 0:
            return f"crash (signal {-self.code})"
        if self.code == ESCAPED or "Traceback (most recent call last)" in self.errors:
            return "traceback"
        return None


def run(
    command: Callable[[], int | None],
    prepare: Callable[[], None],
    folder: Path,
    *,
    seconds: float = WAITING,
) -> Outcome:
    """Run a command in a fork whose working directory is `folder`.

    Args:
        command: gives the exit code.
        prepare: makes the input, before the limits and the watch begin.
    """
    files = {name: folder.with_name(f"{folder.name}.{name}") for name in ("out", "err", "log")}
    begin = time.monotonic()
    pid = os.fork()
    if pid == 0:
        _child(command, prepare, folder, files)
    status, usage = _wait(pid, begin + seconds)
    late = status is None or _code(status) in (-signal.SIGXCPU, -signal.SIGKILL)
    code = None if status is None or late else _code(status)
    found = Outcome(code, usage.ru_utime + usage.ru_stime)
    found.output, found.errors = (_text(files[name]) for name in ("out", "err"))
    start = 0
    for line in _text(files["log"], 2**24).splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "started":
            found.started.add(rest)
        elif kind == "memory":
            start = int(rest)
        elif kind == "opened":
            found.opened.add(rest)
        elif line:
            found.opened.add(line)
    if start:
        found.memory = max(0, 1024 * usage.ru_maxrss - start)
    else:  # it ended before the command began
        found.code = PREPARATION
    for file in files.values():
        file.unlink(missing_ok=True)
    return found


def _child(
    command: Callable[[], int | None],
    prepare: Callable[[], None],
    folder: Path,
    files: dict[str, Path],
) -> None:
    code = PREPARATION
    try:
        os.chdir(folder)
        os.setpgid(0, 0)
        _redirect(files)
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, resource.RLIM_INFINITY))
        prepare()
        code = ESCAPED
        with _watched():
            code = command() or 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _redirect(files: dict[str, Path]) -> None:
    for number, name in ((1, "out"), (2, "err")):
        handle = os.open(files[name], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(handle, number)
    log = os.open(files["log"], os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, LOG)
    # The interpreter's own streams may have been replaced, for example by a test.
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors="replace", closefd=False)
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", errors="replace", closefd=False)


@contextlib.contextmanager
def _watched() -> Iterator[None]:
    """Limits, a hook that reports to descriptor LOG, and the memory from here on."""
    with contextlib.suppress(PermissionError):  # after a change of user
        Path("/proc/self/clear_refs").write_text("5")  # the peak of the memory starts again
    status = Path("/proc/self/status").read_text()
    sizes = {line.split(":")[0]: line.split()[1] for line in status.splitlines() if "kB" in line}
    os.write(LOG, f"memory {1024 * int(sizes['VmRSS'])}\n".encode())
    most = 1024 * int(sizes["VmSize"]) + ADDRESS_SPACE
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ["GRANPINN_OPENS"] = str(LOG)
    sys.addaudithook(_report)
    yield


def _report(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open":
        if isinstance(arguments[0], str | bytes):
            os.write(
                LOG, b"opened " + os.fsencode(arguments[0])[:4000].replace(b"\n", b"?") + b"\n"
            )
    elif event.startswith(STARTED):
        os.write(LOG, f"started {event} {str(arguments)[:2000]!r}\n".encode("utf-8", "replace"))


def _wait(pid: int, deadline: float) -> tuple[int | None, Any]:
    """Status and usage of a process; it is ended with its group at the deadline."""
    handle = os.pidfd_open(pid)
    try:
        ready = select.select([handle], [], [], max(0.0, deadline - time.monotonic()))[0]
    finally:
        os.close(handle)
    if not ready:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pid, signal.SIGKILL)
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    _, status, usage = os.wait4(pid, 0)
    return (status if ready else None), usage


def _code(status: int) -> int:
    return -os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)


def _text(path: Path, most: int = OUTPUT) -> str:
    try:
        with path.open("rb") as stream:
            return stream.read(most).decode("utf-8", "replace")
    except FileNotFoundError:
        return ""
