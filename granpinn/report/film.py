"""The fields over time, for the slider of the page.

Every quantity becomes one sheet of all frames (sheets.py); the page draws its frames from the
sheet. A pixel is the nearest grid point. If the sheets would make the page too large, all of them
get fewer pixels; more than `MAX_FRAMES` frames are thinned out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.ticker import MaxNLocator

from granpinn.arrays import Bytes, Floats, Int64
from granpinn.figures.residual import RESIDUAL_RANGE
from granpinn.figures.style import NothingToDraw
from granpinn.report.pixels import grain_box, pixel_grid
from granpinn.report.sheets import (
    LEVELS,
    OUTSIDE,
    UNSHEARED,
    columns_of,
    indexed_png,
    laid_out,
    mask_png,
    palette,
    quantise,
)
from granpinn.results import Fields
from granpinn.results.zones import D2_STAGNANT

MAX_FRAMES = 200
MAX_PIXELS = 400  # of the longer side of a frame
MIN_PIXELS = 40
BUDGET = 1_500_000  # bytes of all sheets, in base64
DECADES = 1e-4  # a logarithmic scale shows at most this part of its largest value
SHAPES = (0.2, 12.0)  # width over height of the film on the page
OTHER_TIMES = (238, 240, 242)  # colour of places that hold grains at other times
TICKS = 6  # most ticks of the longer axis


class FilmQuantity(NamedTuple):
    """The quantity of a sheet: variables of fields.h5, their combination, and the scale.

    `moving`: it has a meaning only where grains shear.
    """

    label: str
    kind: str
    variables: tuple[str, ...]
    value: Callable[..., Floats]
    log: bool = False
    limits: tuple[float, float] | None = None
    moving: bool = False


QUANTITIES = {
    "speed": FilmQuantity("speed", "velocity", ("u", "v"), np.hypot),
    "pressure": FilmQuantity("pressure", "pressure", ("p",), np.asarray),
    "I": FilmQuantity("inertial number I", "number", ("I",), np.asarray, log=True),
    "D2": FilmQuantity("strain rate D₂", "rate", ("D2",), np.asarray, log=True),
    "residual": FilmQuantity(
        "momentum residual / (ρ |g|), where grains shear",
        "number",
        ("momentum_residual_x", "momentum_residual_y"),
        np.hypot,
        moving=True,
        log=True,
        limits=RESIDUAL_RANGE,
    ),
}


class Sheet(NamedTuple):
    """One quantity: its frames as a PNG in base64, and its colour scale from `low` to `high`.

    `moving`: grains that do not shear have a colour of their own.
    """

    name: str
    label: str
    unit: str
    low: float
    high: float
    log: bool
    moving: bool
    png: str

    @property
    def middle(self) -> float:
        """The value in the middle of the colour scale."""
        return float((self.low * self.high) ** 0.5 if self.log else (self.low + self.high) / 2)


class FilmAxis(NamedTuple):
    """The label of an axis, and its ticks: per cent of the way along it, and text."""

    label: str
    ticks: tuple[tuple[float, str], ...]


class Film(NamedTuple):
    """
    Attributes:
        width, height: of a frame in pixels; y points up.
        shape: width over height on the page.
        columns: frames side by side in a sheet.
        times: of the frames, as text with their unit.
        start: index of the frame to show first.
        still: that frame of the first quantity as a PNG in base64.
        other_times: the places that hold grains at any time, as a PNG in base64.
        x, y: the axes.
        colors: of the scale, from low to high.
    """

    sheets: tuple[Sheet, ...]
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

    @property
    def size(self) -> int:
        """Bytes of all sheets, in base64."""
        return sum(len(sheet.png) for sheet in self.sheets)


def shoot(fields: Fields, frame: int, budget: int = BUDGET) -> Film:
    """The film of a run, which shows frame index `frame` first, with as many pixels as fit.

    Raises:
        NothingToDraw: there are no grains, or none of the variables.
    """
    pixels, film = MAX_PIXELS, film_of(fields, frame)
    while film.size > budget and pixels > MIN_PIXELS:
        longest = max(film.width, film.height)
        pixels = max(MIN_PIXELS, int(0.95 * longest * (budget / film.size) ** 0.5))
        film = film_of(fields, frame, pixels)
    return film


def film_of(fields: Fields, frame: int, pixels: int = MAX_PIXELS) -> Film:
    """The film with at most `pixels` on the longer side of a frame, whatever its size.

    Raises:
        NothingToDraw: as `shoot`.
    """
    shown = [q for q in QUANTITIES.values() if set(q.variables) <= set(fields.values)]
    if not shown:
        raise NothingToDraw("fields.h5 has none of the variables of the film")
    rows, columns = grain_box(fields)
    frames = frames_of(fields.t.size, frame)
    y, x = pixel_grid(fields.y[rows], fields.x[columns], pixels)
    cut = np.ix_(rows.start + y[::-1], columns.start + x)
    pictures = _pictures(fields, frames, cut)
    if not pictures:
        raise NothingToDraw("fields.h5 has no finite value to show")
    across = columns_of(frames.size, y.size, x.size)
    pngs = [indexed_png(laid_out(picture.indices, across)) for picture in pictures]
    start = int(np.searchsorted(frames, frame))
    first = pictures[0].indices
    shape = x.size / y.size
    return Film(
        sheets=tuple(_sheet(fields, p, png) for p, png in zip(pictures, pngs, strict=True)),
        width=x.size,
        height=y.size,
        shape=float(np.clip(shape, *SHAPES)),
        columns=across,
        times=times_of(fields.t[frames], _unit(fields.units.time)),
        start=start,
        still=indexed_png(first[start]),
        other_times=mask_png((first != OUTSIDE).any(axis=0), OTHER_TIMES),
        x=axis("x", fields.x[columns], x.size, fields.units.length, TICKS * min(1.0, shape)),
        y=axis("y", fields.y[rows], y.size, fields.units.length, TICKS / max(1.0, shape)),
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


class _Pictures(NamedTuple):
    """The frames of one quantity [T, H, W] as palette indices, and the ends of its scale."""

    name: str
    indices: Bytes
    low: float
    high: float


def _pictures(fields: Fields, frames: Int64, cut: tuple[Int64, ...]) -> list[_Pictures]:
    made = []
    for name, q in QUANTITIES.items():
        if not set(q.variables) <= set(fields.values):
            continue
        values = np.stack([_values(fields, q, int(k))[cut] for k in frames])
        still = np.zeros(values.shape, bool)
        if q.moving and "D2" in fields.values:
            rate = np.stack([fields.frame("D2", int(k))[cut] for k in frames]) * fields.time
            still = np.isfinite(values) & (rate < D2_STAGNANT)
        limits = scale_of(np.where(still, np.nan, values), q)
        if limits is not None:
            indices = np.where(still, UNSHEARED, quantise(values, *limits, q.log))
            made.append(_Pictures(name, indices.astype(np.uint8), *limits))
    return made


def _sheet(fields: Fields, pictures: _Pictures, png: str) -> Sheet:
    q = QUANTITIES[pictures.name]
    unit = fields.units.of(q.kind)
    text = "" if unit == "1" else (unit or "units of the file")
    return Sheet(pictures.name, q.label, text, pictures.low, pictures.high, q.log, q.moving, png)


def _values(fields: Fields, quantity: FilmQuantity, k: int) -> Floats:
    """The values of a quantity at frame k [Y, X]."""
    return quantity.value(*(fields.frame(v, k) for v in quantity.variables))


def scale_of(values: Floats, quantity: FilmQuantity) -> tuple[float, float] | None:
    """The ends of the colour scale: nearly all values at all times; None without any value."""
    if quantity.limits is not None:
        return quantity.limits if np.isfinite(values).any() else None
    finite = values[np.isfinite(values) & ((values > 0) | (not quantity.log))]
    if finite.size == 0:
        return None
    low, high = np.quantile(finite, (0.002, 0.998)).tolist()
    low = max(low, high * DECADES) if quantity.log else min(low, 0.0)
    if high > low:
        return low, high
    return (low / 10, low) if quantity.log else (low, low + (abs(low) or 1.0))


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"
