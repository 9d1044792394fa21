"""The fields over time, for the slider of the page: frames quantised to a palette of 255 colours.

Every quantity becomes one indexed PNG: a sheet with its frames one below the other. The page draws
its frames from the sheet.  A pixel is the nearest grid point, index 255 is "no grains"
(transparent).  If the sheets would make the page too large, all of them get fewer pixels.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from PIL import Image

from granpinn.arrays import Bytes, Floats, Int64
from granpinn.figures.residual import RESIDUAL_RANGE
from granpinn.figures.style import VALUE_MAP, NothingToDraw
from granpinn.results import Fields
from granpinn.results.zones import D2_STAGNANT

MAX_FRAMES = 25
MAX_PIXELS = 400  # of the longer side of a frame
MIN_PIXELS = 40
BUDGET = 1_500_000  # bytes of all sheets, in base64
OUTSIDE = 255  # palette index of pixels without grains
DECADES = 1e-4  # a logarithmic scale shows at most this part of its largest value


class Quantity(NamedTuple):
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
    "speed": Quantity("speed", "velocity", ("u", "v"), np.hypot),
    "pressure": Quantity("pressure", "pressure", ("p",), np.asarray),
    "I": Quantity("inertial number I", "number", ("I",), np.asarray, log=True),
    "D2": Quantity("strain rate D₂", "rate", ("D2",), np.asarray, log=True),
    "residual": Quantity(
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
    """One quantity: its frames as a PNG in base64, and its colour scale from `low` to `high`."""

    name: str
    label: str
    unit: str
    low: float
    high: float
    log: bool
    png: str

    @property
    def middle(self) -> float:
        """The value in the middle of the colour scale."""
        return float((self.low * self.high) ** 0.5 if self.log else (self.low + self.high) / 2)


class Film(NamedTuple):
    """
    Attributes:
        width, height: of a frame in pixels; y points up.
        times: of the frames, as text with their unit.
        start: index of the frame to show first.
        still: that frame of the first quantity as a PNG in base64.
        x, y: the ranges of the frames, as text.
        colors: of the scale, from low to high.
    """

    sheets: tuple[Sheet, ...]
    width: int
    height: int
    times: tuple[str, ...]
    start: int
    still: str
    x: str
    y: str
    colors: tuple[str, ...]


def shoot(fields: Fields, frame: int, budget: int = BUDGET) -> Film:
    """The film of a run, which shows frame index `frame` (or the nearest one) first.

    Raises:
        NothingToDraw: there are no grains, or none of the variables.
    """
    shown = [q for q in QUANTITIES.values() if set(q.variables) <= set(fields.values)]
    if not shown:
        raise NothingToDraw("fields.h5 has none of the variables of the film")
    rows, columns = grain_box(fields)
    frames = np.unique(np.linspace(0, fields.t.size - 1, MAX_FRAMES).round().astype(int))
    start = int(np.argmin(np.abs(fields.t[frames] - fields.t[frame])))
    pixels = MAX_PIXELS
    while True:
        y, x = pixel_grid(fields.y[rows], fields.x[columns], pixels)
        cut = np.ix_(rows.start + y[::-1], columns.start + x)
        sheets = _sheets(fields, frames, cut)
        if not sheets:
            raise NothingToDraw("fields.h5 has no finite value to show")
        size = sum(len(sheet.png) for sheet in sheets)
        if size <= budget or pixels <= MIN_PIXELS:
            break
        pixels = max(MIN_PIXELS, int(0.95 * max(y.size, x.size) * (budget / size) ** 0.5))
    pictures = np.asarray(Image.open(io.BytesIO(base64.b64decode(sheets[0].png))))
    still = pictures[start * y.size : (start + 1) * y.size]
    return Film(
        sheets=tuple(sheets),
        width=x.size,
        height=y.size,
        times=tuple(f"{t:.3g}{_unit(fields.units.time)}" for t in fields.t[frames]),
        start=start,
        still=_png(still),
        x=_range(fields.x[columns], fields.units.length),
        y=_range(fields.y[rows], fields.units.length),
        colors=tuple("#{:02x}{:02x}{:02x}".format(*rgb) for rgb in palette()[:OUTSIDE:16]),
    )


def grain_box(fields: Fields) -> tuple[slice, slice]:
    """The rows and columns that hold grains at any time."""
    if fields.index.size == 0:
        raise NothingToDraw("fields.h5 has no grid point inside the grains")
    place = fields.index % (fields.y.size * fields.x.size)
    row, column = np.divmod(place, fields.x.size)
    return (
        slice(int(row.min()), int(row.max()) + 1),
        slice(int(column.min()), int(column.max()) + 1),
    )


def pixel_grid(y: Floats, x: Floats, pixels: int) -> tuple[Int64, Int64]:
    """Nearest grid rows [H] and columns [W] of square pixels; the longer side has <= `pixels`.

    Pixels are as fine as the finest grid spacing as long as they fit.
    """
    spacings = np.concatenate([np.diff(y), np.diff(x), [np.inf]])
    longest = max(np.ptp(y), np.ptp(x))
    side = max(float(spacings.min()), float(longest) / pixels)
    return _nearest(y, side, pixels), _nearest(x, side, pixels)


def _nearest(axis: Floats, side: float, pixels: int) -> Int64:
    if axis.size == 1:
        return np.zeros(1, np.int64)
    count = min(pixels, max(1, round(float(np.ptp(axis)) / side) + 1))
    centers = np.linspace(axis[0], axis[-1], count)
    return nearest_index(axis, centers)


def nearest_index(axis: Floats, wanted: Floats) -> Int64:
    """Index [n] of the value of an ascending axis that is nearest to each of `wanted` [n]."""
    middles = (axis[1:] + axis[:-1]) / 2
    return np.asarray(np.searchsorted(middles, wanted), np.int64)


def _sheets(fields: Fields, frames: Int64, cut: tuple[Int64, ...]) -> list[Sheet]:
    made = []
    for name, q in QUANTITIES.items():
        if not set(q.variables) <= set(fields.values):
            continue
        pictures = [_picture(fields, q, int(k))[cut] for k in frames]
        values = np.concatenate(pictures)
        limits = scale_of(values, q)
        if limits is not None:
            unit = fields.units.of(q.kind)
            text = "" if unit == "1" else (unit or "units of the file")
            png = _png(quantise(values, *limits, q.log))
            made.append(Sheet(name, q.label, text, *limits, q.log, png))
    return made


def _picture(fields: Fields, quantity: Quantity, k: int) -> Floats:
    """The values of a quantity at frame k [Y, X]."""
    values = quantity.value(*(fields.frame(v, k) for v in quantity.variables))
    if not quantity.moving or "D2" not in fields.values:
        return values
    moves = fields.frame("D2", k) * fields.time >= D2_STAGNANT
    return np.asarray(np.where(moves, values, np.nan))


def scale_of(values: Floats, quantity: Quantity) -> tuple[float, float] | None:
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


def quantise(values: Floats, low: float, high: float, log: bool) -> Bytes:
    """Palette indices 0..254 of values between `low` and `high`; 255 where there is none."""
    known = np.isfinite(values)
    inside = np.clip(np.where(known, values, low), low, high)
    share = np.log(inside / low) / np.log(high / low) if log else (inside - low) / (high - low)
    return np.where(known, np.rint(share * (OUTSIDE - 1)), OUTSIDE).astype(np.uint8)


def palette() -> Bytes:
    """Colours [256, 3] of the indices; the last one stands for "no grains"."""
    colors = colormaps[VALUE_MAP](np.linspace(0, 1, OUTSIDE))[:, :3]
    return np.concatenate([np.rint(255 * colors), [[255, 255, 255]]]).astype(np.uint8)


def _png(indices: Bytes) -> str:
    image = Image.fromarray(indices)
    image.putpalette(palette().tobytes())
    memory = io.BytesIO()
    image.save(memory, format="PNG", transparency=OUTSIDE, optimize=True)
    return base64.b64encode(memory.getvalue()).decode("ascii")


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _range(axis: Floats, unit: str) -> str:
    return f"{axis[0]:.3g} to {axis[-1]:.3g}{_unit(unit)}"
