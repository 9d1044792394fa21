"""The predicted pressure over time, for the slider of the page.

All frames become one sheet (sheets.py), from which the page draws them. A pixel is the nearest grid
point. If the sheet would make the page too large, it gets fewer pixels; more than `MAX_FRAMES`
frames are thinned out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.ticker import MaxNLocator

from granpinn.arrays import Floats, Int64
from granpinn.figures.style import NothingToDraw
from granpinn.report.pixels import grain_box, pixel_grid
from granpinn.report.sheets import (
    LEVELS,
    OUTSIDE,
    columns_of,
    indexed_png,
    laid_out,
    mask_png,
    palette,
    quantise,
)
from granpinn.results import Fields

MAX_FRAMES = 200
MAX_PIXELS = 400  # of the longer side of a frame
MIN_PIXELS = 40
BUDGET = 1_500_000  # bytes of the sheet, in base64
SHAPES = (0.2, 12.0)  # width over height of the film on the page
OTHER_TIMES = (238, 240, 242)  # colour of places that hold grains at other times
TICKS = 6  # most ticks of the longer axis


class FilmAxis(NamedTuple):
    """The label of an axis, and its ticks: per cent of the way along it, and text."""

    label: str
    ticks: tuple[tuple[float, str], ...]


class Film(NamedTuple):
    """
    Attributes:
        sheet: all frames as a PNG in base64.
        low, high: ends of the colour scale.
        unit: of the pressure; "" for none.
        width, height: of a frame in pixels; y points up.
        shape: width over height on the page.
        columns: frames side by side in the sheet.
        times: of the frames, as text with their unit.
        start: index of the frame to show first.
        still: that frame as a PNG in base64.
        other_times: the places that hold grains at any time, as a PNG in base64.
        x, y: the axes.
        colors: of the scale, from low to high.
    """

    sheet: str
    low: float
    high: float
    unit: str
    width: int
    height: int
    shape: float
    columns: int
    times: tuple[str, ...]
    start: int
    still: str
    other_times: str
    x: FilmAxis
    y: FilmAxis
    colors: tuple[str, ...]


def shoot(fields: Fields, frame: int, budget: int = BUDGET) -> Film:
    """The film of a run, which shows frame index `frame` first, with as many pixels as fit.

    Raises:
        NothingToDraw: there are no grains, or no pressure.
    """
    pixels, film = MAX_PIXELS, film_of(fields, frame)
    while len(film.sheet) > budget and pixels > MIN_PIXELS:
        longest = max(film.width, film.height)
        pixels = max(MIN_PIXELS, int(0.95 * longest * (budget / len(film.sheet)) ** 0.5))
        film = film_of(fields, frame, pixels)
    return film


def film_of(fields: Fields, frame: int, pixels: int = MAX_PIXELS) -> Film:
    """The film with at most `pixels` on the longer side of a frame, whatever its size.

    Raises:
        NothingToDraw: as `shoot`.
    """
    if "p" not in fields.values:
        raise NothingToDraw("fields.h5 has no pressure")
    rows, columns = grain_box(fields)
    frames = frames_of(fields.t.size, frame)
    y, x = pixel_grid(fields.y[rows], fields.x[columns], pixels)
    cut = np.ix_(rows.start + y[::-1], columns.start + x)
    p = np.stack([fields.frame("p", int(k))[cut] for k in frames])
    if not np.isfinite(p).any():
        raise NothingToDraw("fields.h5 has no finite pressure")
    low, high = scale_of(p)
    indices = quantise(p, low, high)
    across = columns_of(frames.size, y.size, x.size)
    start, shape, unit = int(np.searchsorted(frames, frame)), x.size / y.size, fields.units
    pressure = unit.of("pressure")
    return Film(
        sheet=indexed_png(laid_out(indices, across)),
        low=low,
        high=high,
        unit="" if pressure == "1" else (pressure or "units of the file"),
        width=x.size,
        height=y.size,
        shape=float(np.clip(shape, *SHAPES)),
        columns=across,
        times=times_of(fields.t[frames], "" if unit.time == "1" else f" {unit.time}"),
        start=start,
        still=indexed_png(indices[start]),
        other_times=mask_png((indices != OUTSIDE).any(axis=0), OTHER_TIMES),
        x=axis("x", fields.x[columns], x.size, unit.length, TICKS * min(1.0, shape)),
        y=axis("y", fields.y[rows], y.size, unit.length, TICKS / max(1.0, shape)),
        colors=tuple("#{:02x}{:02x}{:02x}".format(*rgb) for rgb in palette()[:LEVELS:16]),
    )


def frames_of(count: int, frame: int) -> Int64:
    """All frames; of more than `MAX_FRAMES` evenly spaced ones, and in any case `frame`."""
    if count <= MAX_FRAMES:
        return np.arange(count)
    some = np.linspace(0, count - 1, MAX_FRAMES - 1).round().astype(np.int64)
    return np.union1d(some, frame)


def times_of(t: Floats, unit: str) -> tuple[str, ...]:
    """Times as text, with as many digits as tell them apart, three to eight."""
    for digits in range(3, 9):
        texts = [f"{time:.{digits}g}" for time in t]
        if len(set(texts)) == len(texts):
            break
    return tuple(text + unit for text in texts)


def axis(name: str, centers: Floats, pixels: int, unit: str, most: float) -> FilmAxis:
    """The axis of a frame, from the outer edge of its first pixel to that of its last.

    Args:
        name: of the coordinate.
        centers: of the grid, of which the first and the last are those of the outer pixels.
        pixels: how many there are.
        unit: of the length; "1" is not shown.
        most: how many steps between ticks there may be; at least 2 are allowed.
    """
    half = float(np.ptp(centers)) / max(1, pixels - 1) / 2 or 0.5
    low, high = float(centers[0]) - half, float(centers[-1]) + half
    locator = MaxNLocator(max(2, round(most)), steps=[1, 2, 2.5, 5, 10])
    values = [float(v) for v in locator.tick_values(low, high) if low <= v <= high]
    ticks = tuple((100 * (v - low) / (high - low), f"{v + 0.0:.6g}") for v in values)
    return FilmAxis(name if unit == "1" else f"{name} [{unit or 'units of the file'}]", ticks)


def scale_of(values: Floats) -> tuple[float, float]:
    """The ends of the colour scale: nearly all finite values at all times."""
    low, high = np.quantile(values[np.isfinite(values)], (0.002, 0.998)).tolist()
    low = min(low, 0.0)
    return (low, high) if high > low else (low, low + (abs(low) or 1.0))
