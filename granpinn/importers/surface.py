"""The grains and their free surface.

**Grains.** The source of the volume fraction is a fraction field, else a mask, else the cells with
vectors. A mask may be an image, black where there are no grains. The surface follows from the
volume fraction, or from the density of tracked grains.

**Fraction.** Between the centers of two neighboring cells, one in the grains and one outside, the
surface lies where c = 1/2 by linear interpolation; for a mask, half way. Some edges of a mask are
no free surface: the bed and the side walls are edges too. An edge counts if it faces up (against
gravity), or if it faces sideways and has grains beyond it at another time. An edge that faces down
never counts.

**Tracked grains.** The centers of a frame are smoothed by a Gaussian kernel with the standard
deviation h. The surface is where the density is half of that inside: there the grains would end if
all of them had the usual density of the inside. h is one grain diameter, so that the kernel is
about two diameters wide. Where only a part of the grains is tracked, h is up to two of their usual
distances. The offset is known to h / 2.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64, nearest
from granpinn.data.flow import Surface
from granpinn.data.surface import line_heights
from granpinn.importers import units
from granpinn.importers.series import expand
from granpinn.importers.vectors import DataFileError, Validity, VectorFields, grains_around
from granpinn.regular import open_regular_file

MAX_IMAGE = 2**30  # bytes
MAX_PIXELS = 2**27
IMAGES = ("PNG", "TIFF", "BMP", "JPEG", "GIF", "PPM", "WEBP")
BRIGHT = 0.5  # of the brightest
HALF = 0.5
_UPWARDS = 0.5  # cosine of the angle to the vertical
FULL = 1e-6  # solvers fill cells up to rounding
CELL = 0.5  # of the grid, in h
# Lost grains leave holes that a kernel of one diameter would show: h grows with the distance of
# neighbors, to twice that distance.
SPARSE, MOST = 4.0, 2.0
MARGIN = 4.0  # above the grains, in h
BULK = 0.75  # quantile of the density at the grains
MAX_AXIS = 2000  # h
MAX_CELLS = 10_000_000  # over all frames
LEVEL_OF_VIEW = 0.25  # scatter of the line in h, below which it is the edge of the picture
SD = 0.5  # of the offset, in h


def from_fraction(
    c: Float64, t: Float64, y: Float64, x: Float64, gravity: tuple[float, float], jitter: int = 0
) -> Surface | None:
    """The free surface of a volume fraction [T, Y, X]; None if there is none.

    Args:
        jitter: cells by which the edge of the grains moves along a wall at rest.
    """
    g = math.hypot(*gravity)
    up = {1: -gravity[1] / g, 2: -gravity[0] / g}  # cosine of each axis with the vertical
    ever = (c > HALF).any(axis=0)
    if jitter:
        ever = scipy.ndimage.binary_erosion(ever, iterations=jitter, border_value=1)
    points = []
    for axis, coordinate in ((1, y), (2, x)):
        low = np.moveaxis(c, axis, 0)[:-1]
        high = np.moveaxis(c, axis, 0)[1:]
        for grains_below in (True, False):
            inner, outer = (low, high) if grains_below else (high, low)
            cosine = up[axis] if grains_below else -up[axis]
            crossing = (inner > HALF) & (outer <= HALF)
            if cosine < -_UPWARDS:
                continue
            if cosine < _UPWARDS:
                seen = np.moveaxis(np.broadcast_to(ever, c.shape), axis, 0)
                crossing &= seen[1:] if grains_below else seen[:-1]
            place = np.nonzero(crossing)
            share = (HALF - low[place]) / (high[place] - low[place])
            along = coordinate[place[0]] + share * np.diff(coordinate)[place[0]]
            # After moveaxis the other axes keep their order: (frame, column) or (frame, row).
            other = (x if axis == 1 else y)[place[2]]
            pair = (other, along) if axis == 1 else (along, other)
            points.append(np.stack([t[place[1]], *pair]))
    found = np.concatenate(points, axis=1)
    if found.shape[1] == 0:
        return None
    found = found[:, np.lexsort((found[2], found[1], found[0]))]
    return Surface(t=found[0], x=found[1], y=found[2])


def grains_of(fields: VectorFields) -> tuple[Float64, str]:
    """Volume fraction [T, Y, X] of vectors on a grid, and where it comes from."""
    if fields.c is not None:
        c = np.clip(np.nan_to_num(fields.c), 0.0, 1.0)  # NaN: no grains; beyond 0 and 1: rounding
        c[c > 1 - FULL] = 1.0
        c[fields.validity == Validity.MASKED] = 0.0
        return c, "fraction"
    masked = fields.validity == Validity.MASKED
    if masked.any():
        return (~masked).astype(np.float64), "mask"
    c = np.stack([grains_around(frame) for frame in fields.usable]).astype(np.float64)
    return c, "vectors"


def with_mask(fields: VectorFields, pattern: str) -> VectorFields:
    """Masks the vectors where an image is black; one image for all frames or one for each.

    Black (below half of the brightest) means no grains. The coordinates of the vectors must be
    pixels, and y as in the image.
    """
    if fields.scattered:
        raise DataFileError("--mask is for vectors on a grid, got scattered ones: leave it out")
    if not units.has(fields.length_unit, "px"):
        raise DataFileError(
            "--mask needs vectors in pixels to find them in the image, got "
            f"{fields.length_unit or 'no unit'}: export them without calibration, give "
            "--length-unit px if they are in pixels, or use the mask of the PIV program"
        )
    files = expand([pattern])
    n_frames = fields.t.size
    if len(files) not in (1, n_frames):
        raise DataFileError(
            f"--mask must be one image or one for each of the {n_frames} frames, got {len(files)}"
        )
    masks = [_at_vectors(file, _picture(file), fields) for file in files]
    outside = ~np.broadcast_to(np.stack(masks), fields.u.shape)
    codes = np.where(outside, np.int8(Validity.MASKED), fields.validity)
    return replace(fields, validity=codes)


def _picture(file: Path) -> Any:
    """The grey levels of an image of moderate size, in one of the formats of cameras and masks."""
    from PIL import Image, UnidentifiedImageError

    try:
        with (
            open_regular_file(file, MAX_IMAGE) as stream,
            Image.open(stream, formats=IMAGES) as image,
        ):
            if image.width * image.height > MAX_PIXELS:
                raise ValueError(f"{image.width} x {image.height} pixels are too many")
            if (count := getattr(image, "n_frames", 1)) > 1:
                raise ValueError(f"it holds {count} images, save each in a file")
            clear = image.has_transparency_data
            if clear and np.asarray(image.convert("RGBA"))[..., 3].min() < 255:
                raise ValueError("it is partly transparent, save it without transparency")
            # To 8 bits, convert cuts off what lies above 255.
            deep = image.mode in ("I", "F") or image.mode.startswith("I;16")
            return np.asarray(image if deep else image.convert("L"))
    except Exception as error:  # of any kind, for damaged files
        reason = str(error)
        if isinstance(error, UnidentifiedImageError):  # its message names the stream
            reason = f"it is damaged, or none of {', '.join(IMAGES)}"
        raise DataFileError(f"{file} cannot be read as an image: {reason}") from None


def _at_vectors(file: Path, picture: Any, fields: VectorFields) -> Bool:
    found = []
    axes = {"y": (np.rint(fields.y), picture.shape[0]), "x": (np.rint(fields.x), picture.shape[1])}
    for name, (places, size) in axes.items():
        index = size - 1 - places if name == "y" and fields.y_down is False else places
        if index.min() < 0 or index.max() > size:
            raise DataFileError(
                f"{file} must cover the vectors, got {size} pixels along {name} and vectors at "
                f"{index.min():g} to {index.max():g}: use the mask of the same camera"
            )
        found.append(np.minimum(index.astype(int), size - 1))
    rows, columns = found
    bright = picture > BRIGHT * picture.max()
    return np.asarray(bright[np.ix_(rows, columns)])


def below_line(fields: VectorFields, line: Surface) -> Bool:
    """Cells [T, Y, X] below a line of points; each frame has the points nearest in time."""
    times = np.unique(line.t)
    height = line_heights(times, fields.x, line)[nearest(times, fields.t)]
    return np.asarray(fields.y[:, None] <= height[:, None])


def surface_of_grains(
    t: Float64, x: Float64, y: Float64, diameter: float, gravity: tuple[float, float]
) -> tuple[Surface, float] | None:
    """The free surface of tracked grains and the standard deviation of its offset.

    Args:
        t, x, y: of every grain in every frame [n], y up.

    Returns:
        None if the grains reach the edge of the picture everywhere, if no edge faces up, or if
        one grain is far from all others.
    """
    order = np.argsort(t, kind="stable")
    x, y = x[order], y[order]
    times, first = np.unique(t[order], return_index=True)
    ends = np.append(first, t.size)
    width, height = float(np.ptp(x)), float(np.ptp(y))
    h = max(diameter, math.sqrt(width * height * times.size / t.size))
    if max(width, height) > MAX_AXIS * h:  # a grain far from all others
        return None
    fullest = int(np.argmax(np.diff(ends)))
    now = slice(ends[fullest], ends[fullest + 1])
    distance = _distance(x[now], y[now], h)
    h = min(diameter + SPARSE * max(distance - diameter, 0.0), MOST * distance)
    h = max(h, diameter)
    if max(width, height) > MAX_AXIS * h:
        return None
    kept = np.arange(times.size)
    cell = CELL * h
    up = np.array([-gravity[0], -gravity[1]]) / math.hypot(*gravity)
    edges = []
    for values, towards in ((x, up[0]), (y, up[1])):
        # Grains that touch a wall have their mirror image behind it; above them is nothing.
        low = float(values.min()) - (MARGIN * h if towards < -CELL else 0.0)
        high = float(values.max()) + (MARGIN * h if towards > CELL else 0.0)
        count = max(2, math.ceil((high - low) / cell))
        edges.append(low + cell * np.arange(count + 1))
    columns, rows = (edge.size - 1 for edge in edges)
    if times.size * rows * columns > MAX_CELLS:
        most = max(2, MAX_CELLS // (rows * columns))
        kept = np.unique(np.linspace(0, times.size - 1, most).round().astype(int))
    c = np.zeros((kept.size, rows, columns))
    for place, k in zip(c, kept, strict=True):
        now = slice(ends[k], ends[k + 1])
        counts, *_ = np.histogram2d(y[now], x[now], bins=(edges[1], edges[0]))
        density = scipy.ndimage.gaussian_filter(counts, h / cell, mode="reflect")
        inside = density[counts > 0]
        bulk = float(np.quantile(inside, BULK)) if inside.size else 0.0
        if bulk > 0:
            place[:] = without_holes(np.minimum(density / bulk, 1.0), up)
    centers = [(edge[1:] + edge[:-1]) / 2 for edge in edges]
    found = from_fraction(c, times[kept], centers[1], centers[0], gravity)
    if found is None or _is_edge_of_view(found, up, h):
        return None
    return found, SD * h


def without_holes(c: Float64, up: Float64) -> Float64:
    """The fraction with gaps among the grains filled, and without grains apart from the body."""
    walls = [(int(-t < CELL), int(t < CELL)) for t in (up[1], up[0])]
    grown = np.pad(c > HALF, walls, constant_values=True)
    inner = tuple(slice(a, n - b) for (a, b), n in zip(walls, grown.shape, strict=True))
    filled = scipy.ndimage.binary_fill_holes(grown)[inner]
    bodies, count = scipy.ndimage.label(filled)
    if count == 0:
        return c
    sizes = np.bincount(bodies.ravel())[1:]
    body = bodies == 1 + int(np.argmax(sizes))
    return np.where(
        body, np.maximum(c, np.where(filled & (c <= HALF), 1.0, 0.0)), np.minimum(c, HALF)
    )


def _distance(x: Float64, y: Float64, guess: float) -> float:
    """Usual distance of the grains of a frame, from the fuller ones of large cells."""
    cells = 4 * guess
    bins = [np.arange(a.min(), a.max() + cells, cells) for a in (y, x)]
    if min(b.size for b in bins) < 2:
        return guess
    counts, *_ = np.histogram2d(y, x, bins=bins)
    return cells / math.sqrt(float(np.quantile(counts[counts > 0], BULK)))


def _is_edge_of_view(line: Surface, up: Float64, h: float) -> bool:
    """Whether the line is straight and never moves, as where a picture cuts off the grains."""
    return float(np.std(line.x * up[0] + line.y * up[1])) < LEVEL_OF_VIEW * h
