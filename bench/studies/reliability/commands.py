"""The commands as functions, with all that they import."""

from __future__ import annotations

import base64
import contextlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any
from unittest import mock

from granpinn.commands import train
from granpinn.commands.convert import main as convert
from granpinn.commands.inspect import main as inspect
from granpinn.commands.report import main as report
from granpinn.commands.simulate import main as simulate
from granpinn.commands.tables import main as tables

MAINS: dict[str, Callable[[Sequence[str]], int]] = {
    "inspect": inspect,
    "convert": convert,
    "train": train.main,
    "report": report,
    "simulate": simulate,
    "tables": tables,
}
LATE = ("h5netcdf", "xarray", "zarr", "pyvista", "lvpyio", "pandas", "tables", "PIL.Image")
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
