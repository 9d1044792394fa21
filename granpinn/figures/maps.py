"""Maps of the grains at one time: pressure and speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from granpinn.arrays import Float64, Floats
from granpinn.data import Flow
from granpinn.data.scaling import origin_of
from granpinn.figures.style import (
    BLACK,
    DIFFERENCE_MAP,
    VALUE_MAP,
    WIDTH,
    Drawing,
    NothingToDraw,
    label,
    new_figure,
    styled,
)
from granpinn.results import Fields

TIME_SHARE = 0.7  # of the last time: the collapse is under way and a stagnant zone has formed
WIDE = 1.3  # maps with a smaller height / width are stacked
TALLEST = 1.9  # inches of a stacked map


class Window(NamedTuple):
    """One frame, cut to the grains and one cell around them."""

    k: int
    rows: slice
    columns: slice


class Map(NamedTuple):
    """One field [Y, X] with its colors; `text` labels the color bar."""

    title: str
    values: Floats
    norm: Normalize
    text: str
    colormap: str = VALUE_MAP
    extend: str = "neither"


def frame_at(fields: Fields, time: float | None) -> int:
    """The frame nearest to a time, by default to 0.7 of the last one."""
    start = origin_of(fields.t)
    wanted = start + TIME_SHARE * (fields.t[-1] - start) if time is None else time
    return int(np.argmin(np.abs(fields.t - wanted)))


def grain_window(fields: Fields, k: int) -> Window:
    """The rows and columns of frame k that hold grains."""
    inside = np.isfinite(fields.frame("p", k)) | (fields.c[k] > 0.5)
    if not inside.any():
        raise NothingToDraw(f"no grid point lies inside the grains at t = {fields.t[k]:.3g}")
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    return Window(
        k,
        slice(max(int(rows[0]) - 1, 0), int(rows[-1]) + 2),
        slice(max(int(columns[0]) - 1, 0), int(columns[-1]) + 2),
    )


@styled
def map_of_grid(
    flow: Flow, values: Float64, text: str, limits: tuple[float, float] | None = None
) -> Drawing:
    """One field [Y, X] over the whole grid of a flow; `text` labels its colors."""
    aspect = float(np.ptp(flow.y) / np.ptp(flow.x))
    figure = new_figure(float(np.clip((WIDTH - 1.6) * aspect + 0.7, 2.4, 7.0)))
    norm = Normalize(*(limits or (0.0, _quantile(values, 0.998) or 1.0)))
    draw_map(figure.subplots(), flow.x, flow.y, flow.length_unit, Map("", values, norm, text))
    return Drawing(figure, text)


@styled
def pressure_fields(fields: Fields, time: float | None) -> Drawing:
    """Predicted pressure, the reference and their difference, where there is a reference."""
    k = frame_at(fields, time)
    reference = fields.frame("p_reference", k) if "p_reference" in fields.values else None
    unit = fields.units.of("pressure")
    drawing = _compare(fields, k, "$p$", unit, fields.frame("p", k), reference)
    if reference is not None:
        return drawing
    return drawing._replace(caption=drawing.caption + " The flow file has no reference pressure.")


@styled
def velocity_fields(fields: Fields, time: float | None) -> Drawing:
    """Predicted speed, the speed in the flow file and their difference."""
    k = frame_at(fields, time)
    found, known = (
        np.hypot(fields.frame(f"u{of}", k), fields.frame(f"v{of}", k)) for of in ("", "_reference")
    )
    unit = fields.units.of("velocity")
    return _compare(fields, k, "$|v|$", unit, found, known, "flow file")


def _compare(
    fields: Fields,
    k: int,
    symbol: str,
    unit: str | None,
    found: Floats,
    known: Floats | None,
    source: str = "reference",
) -> Drawing:
    """A predicted field, the known one, and their difference."""
    values = value_norm(found if known is None else np.stack([found, known]))
    shown = [Map(f"{symbol} predicted", found, values, label(symbol, unit))]
    caption = f"In the grains at {_time(fields, k)}"
    if known is None:
        return Drawing(_maps(fields, grain_window(fields, k), shown), f"{caption}: predicted.")
    shown += [
        Map(f"{symbol} of the {source}", known, values, label(symbol, unit)),
        _difference("difference", found - known, label(rf"$\Delta${symbol}", unit)),
    ]
    caption += f": (a) predicted, (b) {source}, (c) difference. Black: free surface."
    return Drawing(_maps(fields, grain_window(fields, k), shown), caption)


def _difference(title: str, values: Floats, text: str) -> Map:
    """A map of a difference, with 0 in the middle of the colors."""
    reach = _quantile(np.abs(values), 0.99) or 1.0
    return Map(title, values, Normalize(-reach, reach), text, DIFFERENCE_MAP, "both")


def _time(fields: Fields, k: int) -> str:
    unit = "" if fields.units.time == "1" else f" {fields.units.time}"
    return f"t = {fields.t[k]:.3g}{unit}"


def aspect_of(fields: Fields, window: Window) -> float:
    """Height over width of a window."""
    width, height = np.ptp(fields.x[window.columns]), np.ptp(fields.y[window.rows])
    return float(height / width) if width > 0 and height > 0 else 1.0


def stacked_height(aspect: float) -> float | None:
    """Height in inches of maps that stand one above the other; None: they stand side by side."""
    return min((WIDTH - 1.6) * aspect, TALLEST) if aspect < WIDE else None


def _maps(fields: Fields, window: Window, shown: Sequence[Map]) -> Figure:
    """A figure of maps: one above the other for wide grains, else side by side."""
    aspect, count = aspect_of(fields, window), len(shown)
    if height := stacked_height(aspect):
        figure = new_figure((height + 0.5) * count + 0.3)
        grid = figure.subplots(count, 1, squeeze=False, sharex=True, sharey=True)
    else:
        figure = new_figure(min(((WIDTH - 0.6) / count - 0.9) * aspect + 0.9, 7.0))
        grid = figure.subplots(1, count, squeeze=False, sharex=True, sharey=True)
    for letter, axes, one in zip("abc", grid.ravel(), shown, strict=False):
        draw_grains(axes, fields, window, one._replace(title=f"({letter}) {one.title}"))
        axes.label_outer()
    return figure


def draw_map(
    axes: Axes, x: Float64, y: Float64, unit: str | None, one: Map, c: Floats | None = None
) -> None:
    """One map with its axes, color bar and the free surface, where c [Y, X] is 0.5."""
    look: dict[str, Any] = {"shading": "nearest", "rasterized": True}
    cut = np.ma.masked_invalid(one.values)
    image = axes.pcolormesh(x, y, cut, norm=one.norm, cmap=one.colormap, **look)
    if c is not None and min(c.shape) > 1 and c.min() < 0.5 < c.max():
        axes.contour(x, y, c, levels=[0.5], colors=BLACK, linewidths=0.9)
    axes.set_aspect("equal")
    axes.set_title(one.title)
    axes.set_xlabel(label("$x$", unit))
    axes.set_ylabel(label("$y$", unit))
    bar: dict[str, Any] = {"label": one.text, "extend": one.extend, "pad": 0.02, "aspect": 14}
    axes.figure.colorbar(image, ax=axes, **bar)


def draw_grains(axes: Axes, fields: Fields, window: Window, one: Map) -> None:
    """A map of the grains in a window, with the free surface."""
    k, rows, columns = window
    cut = one._replace(values=one.values[rows, columns])
    c = np.nan_to_num(fields.c[k, rows, columns])
    draw_map(axes, fields.x[columns], fields.y[rows], fields.units.of("length"), cut, c)


def value_norm(values: Floats) -> Normalize:
    """From 0, or the smallest value below it, to the largest, without outliers."""
    return Normalize(min(0.0, _quantile(values, 0.002)), _quantile(values, 0.998))


def _quantile(values: Floats, share: float) -> float:
    finite = values[np.isfinite(values)]
    return float(np.quantile(finite, share)) if finite.size else 0.0
