"""Profiles of pressure and speed along x at three heights."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from granpinn.arrays import Floats
from granpinn.figures.maps import Window, draw_surface, grain_window
from granpinn.figures.style import (
    BLACK,
    HEIGHT_COLORS,
    Drawing,
    NothingToDraw,
    label,
    new_figure,
    styled,
)
from granpinn.results import Fields

HEIGHT_SHARES = (0.1, 0.4, 0.7)  # of the height of the grains at that time
MARKS = 25  # reference values drawn per profile


@styled
def profiles(fields: Fields, k: int) -> Drawing:
    """Speed and pressure along three rows of the grid; lines predicted, dots the flow file."""
    window = grain_window(fields, k)
    rows = profile_rows(fields, k)
    if not rows:
        raise NothingToDraw(f"the grains are thinner than a grid cell at t = {fields.t[k]:.3g}")
    speed = np.hypot(fields.frame("u", k), fields.frame("v", k))
    known_speed = np.hypot(fields.frame("u_reference", k), fields.frame("v_reference", k))
    pressure = fields.frame("p", k)
    known = fields.frame("p_reference", k) if "p_reference" in fields.values else None

    count = 3 if known is None else 4
    figure = new_figure(1.75 * count + 0.3)
    panels = figure.subplots(count, 1, sharex=True)
    _outline(panels[0], fields, window, rows)
    unit = fields.units.of
    _lines(panels[1], fields, rows, speed, known_speed)
    panels[1].set_ylabel(label("$|v|$", unit("velocity")))
    panels[1].set_title("(b) speed: lines predicted, dots flow file")
    _lines(panels[2], fields, rows, pressure, known)
    panels[2].set_ylabel(label("$p$", unit("pressure")))
    panels[2].set_title(
        "(c) pressure: lines predicted" + (", dots reference" if known is not None else "")
    )
    if known is not None:
        largest = float(np.nanmax(np.abs(known), initial=0.0)) or 1.0
        _lines(panels[3], fields, rows, 100 * (pressure - known) / largest, None)
        panels[3].axhline(0, color=BLACK, lw=0.7)
        panels[3].set_ylabel(r"$\Delta p\,/\,\max p$ [%]")
        panels[3].set_title("(d) pressure difference")
    panels[-1].set_xlabel(label("$x$", unit("length")))
    where = ", ".join(f"{fields.y[row]:.3g}" for row in rows)
    missing = "" if known is not None else " The flow file has no reference pressure."
    caption = f"Profiles at t = {fields.t[k]:.3g} along the heights y = {where}.{missing}"
    return Drawing(figure, caption)


def profile_rows(fields: Fields, k: int) -> list[int]:
    """The rows nearest to 0.1, 0.4 and 0.7 of the height of the grains at frame k, each once."""
    filled = np.flatnonzero(np.isfinite(fields.frame("p", k)).any(axis=1))
    if filled.size == 0:  # the grains are thinner than one cell
        return []
    bottom, top = fields.y[filled[0]], fields.y[filled[-1]]
    heights = [bottom + share * (top - bottom) for share in HEIGHT_SHARES]
    return sorted({int(filled[np.argmin(np.abs(fields.y[filled] - y))]) for y in heights})


def _outline(axes: Axes, fields: Fields, window: Window, rows: list[int]) -> None:
    """The free surface, and the lines of the profiles in the grains."""
    draw_surface(axes, fields, window)
    inside = fields.c[window.k] > 0.5
    for row, color in zip(rows, HEIGHT_COLORS, strict=False):
        x = np.where(inside[row], fields.x, np.nan)
        axes.plot(x, np.full(x.size, fields.y[row]), color=color, label=f"y = {fields.y[row]:.3g}")
    axes.set_ylabel(label("$y$", fields.units.of("length")))
    axes.set_title("(a) free surface and heights of the profiles")
    axes.set_ylim(bottom=min(0.0, float(fields.y[0])))
    axes.legend(loc="upper right")


def _lines(
    axes: Axes, fields: Fields, rows: list[int], values: Floats, marks: Floats | None
) -> None:
    for row, color in zip(rows, HEIGHT_COLORS, strict=False):
        axes.plot(fields.x, values[row], color=color)
        if marks is not None:
            every = max(1, int(np.isfinite(marks[row]).sum()) // MARKS)
            dots = marks[row, ::every]
            axes.plot(fields.x[::every], dots, "o", color=color, ms=3.6, mfc="white", mew=1.0)
    axes.grid(True)
