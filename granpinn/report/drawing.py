"""Processes that draw the figures of a run side by side.

matplotlib is Python, and Python runs one thread at a time. One process loads the libraries beside a
training on a GPU, which leaves the cores of the CPU idle, and is copied when there is something to
draw. Where the CPU trains, the figures are drawn in the process of the command.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache, partial
from multiprocessing import forkserver
from pathlib import Path

from granpinn.figures.album import Draw, Picture, draw_one
from granpinn.report.page import read
from granpinn.results.attempt import NotDone

MOST = 8  # processes; a run has about ten figures


@contextmanager
def drawers(folder: Path) -> Iterator[Draw]:
    """Yield what draws the figures of a run folder; the libraries are loaded meanwhile."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    forkserver.ensure_running()
    count = min(MOST, max(1, len(os.sched_getaffinity(0)) // 2))
    with ProcessPoolExecutor(count, mp_context=context) as pool:
        yield lambda names: pool.map(partial(_drawn, folder), names)


_read = cache(read)  # once in each process


def _drawn(folder: Path, name: str) -> Picture | NotDone:
    source, _ = _read(folder)
    return draw_one(source, folder / "figures", name)
