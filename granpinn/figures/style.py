"""The style of all figures: sizes, colours, labels, and the writing of a figure to a file.

The colours are by Okabe and Ito and the maps are perceptually uniform, so that figures stay
readable for colour-blind readers and in grey print.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from granpinn.output import write_bytes

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # no axis has ticks at its top, for which matplotlib would look each time
    "axes.labelsize": 10,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "figure.dpi": 180,
    "figure.facecolor": "white",
}
WIDTH = 5.4  # inches; the letters can be read on a phone and are not large on a desk

BLUE, ORANGE, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
SKY, YELLOW, GREY, BLACK = "#56B4E9", "#E69F00", "#8a8a8a", "#111111"

VALUE_MAP, DIFFERENCE_MAP = "viridis", "RdBu_r"


class Drawing(NamedTuple):
    """A figure and the sentence below it."""

    figure: Figure
    caption: str


class NothingToDraw(ValueError):
    """The run folder lacks the data of a figure; the message names them."""


P = ParamSpec("P")


def _look() -> AbstractContextManager[None]:
    """`STYLE` over matplotlib's own defaults, whatever the settings of the caller."""
    return mpl.rc_context({**mpl.rcParamsDefault, **STYLE})  # type: ignore[dict-item]


def styled(draw: Callable[P, Drawing]) -> Callable[P, Drawing]:
    """Run a drawing function under `STYLE`, without touching the caller's settings."""

    @wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Drawing:
        with _look():
            return draw(*args, **kwargs)

    return wrapper


def new_figure(height: float) -> Figure:
    """An empty figure, without pyplot and its global state; its height in inches."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def label(symbol: str, unit: str | None) -> str:
    """Axis label: "$v$ [m/s]"; the symbol alone where the unit is "1".

    The unit comes from a file: a dollar sign in it must not start a formula.
    """
    if unit == "1":
        return symbol
    unit = (unit or "units of the file").replace("$", r"\$")
    return f"{symbol} [{unit}]"


def png(figure: Figure) -> bytes:
    """The figure as a PNG, whose bytes depend on the figure only: no date, no version."""
    file = io.BytesIO()
    with _look():
        canvas: Any = FigureCanvasAgg(figure)  # savefig would draw twice: once for the layout
        canvas.print_png(file, metadata={"Software": None})
    return file.getvalue()


def save(figure: Figure, path: Path) -> None:
    """Write a PNG."""
    write_bytes(path, png(figure))
