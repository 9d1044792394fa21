"""What a figure shows: its lines and the words of its legend."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from tests.run_folder import Array


def line(axes: Axes, name: str) -> Line2D:
    (found,) = (item for item in axes.lines if item.get_label() == name)
    return found


def xy(found: Line2D) -> tuple[Array, Array]:
    return np.asarray(found.get_xdata(), float), np.asarray(found.get_ydata(), float)


def labels(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [text.get_text() for text in legend.get_texts()] if legend else []
