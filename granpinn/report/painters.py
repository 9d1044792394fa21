"""Processes that draw the figures of a run side by side.

matplotlib is Python, and Python runs one thread at a time. A process takes seconds to load its
libraries, so it is started before it is needed: beside a training on a GPU, which leaves the cores
of the CPU idle. Where the CPU trains, the figures are drawn in the process of the command.
"""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

PROGRAM = "granpinn.report.painter"
MOST = 8  # processes; a run has about ten figures
NAMES = ""  # the line that asks for the names of the figures


class Painted(NamedTuple):
    """A figure that was written: its title and caption, and its narrow PNG for phones."""

    title: str
    caption: str
    phone: bytes


class Painters:
    """`count` processes that draw figures of one run folder."""

    def __init__(self, folder: Path, count: int) -> None:
        self._folder = folder
        words = [sys.executable, "-P", "-m", PROGRAM, str(folder.resolve())]
        self._processes = [
            subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                start_new_session=True,  # Ctrl-C is for the command, which ends them
            )
            for _ in range(count)
        ]

    def draw(self) -> dict[str, Painted]:
        """Draw the figures, each in the next idle process; those that could be drawn, by name."""
        idle: SimpleQueue[subprocess.Popen[str]] = SimpleQueue()
        for process in self._processes:
            idle.put(process)

        def one(name: str) -> Painted | None:
            process = idle.get()
            try:
                found = _answer(process, name)
            finally:
                idle.put(process)
            return found and Painted(**found | {"phone": base64.b64decode(found["phone"])})

        names = _answer(self._processes[0], NAMES) or []
        with ThreadPoolExecutor(len(self._processes)) as pool:
            found = zip(names, pool.map(one, names), strict=True)
            return {name: painted for name, painted in found if painted is not None}

    def stop(self) -> None:
        """End the processes, also those that still draw."""
        for process in self._processes:
            process.kill()
        for process in self._processes:
            process.communicate()


def _answer(process: subprocess.Popen[str], line: str) -> Any:
    """The answer of a process to a line; None if there is none, or the process has ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(f"{line}\n")
        process.stdin.flush()
    except BrokenPipeError:
        return None
    return json.loads(process.stdout.readline() or "null")


@contextmanager
def painters(folder: Path) -> Iterator[Painters]:
    """Yield painters of a run folder for half of the cores at hand; end them after the block."""
    cores = len(os.sched_getaffinity(0))
    made = Painters(folder, min(MOST, max(1, cores // 2)))
    try:
        yield made
    finally:
        made.stop()
