"""The friction law of both halves of the data, for every split."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from granpinn.figures.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    WIDTH,
    Drawing,
    NothingToDraw,
    new_figure,
    styled,
    width,
)
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from granpinn.results.parts import Split

COLUMNS = 2  # one on phones
HEIGHT = 2.6  # inches of a panel
POINTS = 100  # of a curve


@styled
def law_on_parts(result: Result) -> Drawing:
    """mu(I) of each half over the I that it holds; the line marks where both are compared."""
    if result.parts is None or not result.parts.splits:
        raise NothingToDraw("the law on parts of the data is not known")
    splits = result.parts.splits
    columns = COLUMNS if width() == WIDTH else 1
    rows = -(-len(splits) // columns)
    figure = new_figure(HEIGHT * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, split in zip(panels, splits, strict=False):
        _curves(axes, split, result)
    for axes in panels[len(splits) :]:
        axes.set_visible(False)
    text = str(result.parts)
    return Drawing(
        figure,
        f"Friction of each half of the data over the I of 5 % to 95 % of it. {text[0].upper()}"
        f"{text[1:]}.",
    )


def _curves(axes: Axes, split: Split, result: Result) -> None:
    law = LAWS[result.law.name]
    for part, color in zip(split.parts, (BLUE, ORANGE), strict=True):
        I = np.geomspace(part.I_low, part.I_high, POINTS)  # noqa: E741
        mu = np.broadcast_to(law.friction(I, *part.theta.values()), I.shape)
        axes.plot(I, mu, color=color, label=part.name)
        whole = np.broadcast_to(law.friction(I, *result.theta), I.shape)
        axes.plot(I, whole, color=GREY, lw=1.0, ls=(0, (4, 3)))
    axes.set_xscale("log")
    # Half of the data holds about a decade of I.
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("inertial number $I$")
    axes.set_ylabel(r"$\mu(I)$")
    axes.grid(True)
    axes.legend()
    if split.percent is None or split.I is None:
        axes.set_title("not compared")
        return
    axes.axvline(split.I, color=BLACK, lw=1.0, ls=(0, (1, 2)))
    limit = split.limit_percent
    axes.set_title(
        f"{split.percent:+.2g} % ({'limit not known' if limit is None else f'limit {limit:.2g} %'})"
    )
