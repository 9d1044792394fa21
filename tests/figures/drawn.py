"""What a figure shows: its lines, its bars and the words of its legend."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from tests.run_folder import Array


def line(axes: Axes, name: str) -> Line2D:
    (found,) = (item for item in axes.lines if item.get_label() == name)
    return found


def xy(found: Line2D) -> tuple[Array, Array]:
    return np.asarray(found.get_xdata(), float), np.asarray(found.get_ydata(), float)


def shares(axes: Axes) -> Array:
    """The heights of the bars of a histogram, from the path around all of them."""
    outline = axes.patches[0]
    assert isinstance(outline, Polygon)
    corners = outline.get_xy()
    # Up and right for every bar, then back along the base.
    count = (len(corners) + 3) // 4 - 1
    return np.asarray(corners[1 : 2 * count : 2, 1], float)


def labels(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [text.get_text() for text in legend.get_texts()] if legend else []
