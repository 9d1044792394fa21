"""The commands as functions, with all that they import."""

from __future__ import annotations

import base64
import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any
from unittest import mock

from granpinn.commands import train
from granpinn.commands.convert import main as convert
from granpinn.commands.inspect import main as inspect
from granpinn.commands.report import main as report
from granpinn.commands.simulate import main as simulate
from granpinn.foreign import process

MAINS: dict[str, Callable[[Sequence[str]], int]] = {
    "inspect": inspect,
    "convert": convert,
    "train": train.main,
    "report": report,
    "simulate": simulate,
}
LATE = ("h5netcdf", "xarray", "pyvista", "lvpyio", "pandas", "PIL.Image")
EMPTY_IMAGE = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNkYAAAAAYAAjCB0C8AAAAASUVORK5CYII="
)


@contextlib.contextmanager
def without_drawing() -> Iterator[None]:
    """Figures are composed, but an empty image is saved: drawing takes most of the time."""

    def save(canvas: Any, file: Any, **_: Any) -> None:
        file.write(EMPTY_IMAGE)

    with mock.patch("matplotlib.backends.backend_agg.FigureCanvasAgg.print_png", save):
        yield


def import_late_modules() -> None:
    """Import what commands import when they need it: once, before all forks."""
    for name in LATE:
        with contextlib.suppress(ImportError):
            __import__(name)


def start_reader() -> None:
    """Start the process that opens files, if none runs: its imports take longer than a mutant."""
    if not process._running or process._running[0].process.poll() is not None:
        process._running[:] = [process._Process()]


def take_reader() -> None:
    """Use the process that opens files in a fork, which runs while the others wait."""
    process._running[0].owner = os.getpid()


def end_reader() -> None:
    """End the process that opens files, which may still be at a request."""
    process._close()
