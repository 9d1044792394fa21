"""The volume fraction c of every cell, from the files and settings.

Its source is a fraction field, else a mask of files or images, else the cells with vectors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.importers.gaps import grains_around
from granpinn.importers.series import expand
from granpinn.importers.vectors import DataFileError, Validity, VectorFields

FULL = 1e-6  # solvers fill cells up to rounding
_BRIGHT = 0.5


@dataclass(frozen=True, eq=False)
class Grains:
    """Volume fraction [T, Y, X] and where it comes from."""

    c: Float64
    source: str


def grains_of(fields: VectorFields) -> Grains:
    """The grains of vectors on a grid."""
    if fields.c is not None:
        c = np.clip(np.nan_to_num(fields.c), 0.0, 1.0)
        c[c > 1 - FULL] = 1.0
        c[fields.validity == Validity.MASKED] = 0.0
        return Grains(c, "fraction")
    masked = fields.validity == Validity.MASKED
    if masked.any():
        return Grains((~masked).astype(np.float64), "mask")
    c = np.stack([grains_around(frame) for frame in fields.usable]).astype(np.float64)
    return Grains(c, "vectors")


def with_mask(fields: VectorFields, pattern: str, length_unit: str | None) -> VectorFields:
    """Masks the vectors where an image is black; one image for all frames or one for each.

    Black (below half of the brightest) means no grains. The coordinates of the vectors must be
    pixels, and y as in the image.
    """
    from PIL import Image, UnidentifiedImageError

    if fields.scattered:
        raise DataFileError("--mask is for vectors on a grid, got scattered ones: leave it out")
    if length_unit is None or not length_unit.startswith(("px", "pix", "Pix")):
        raise DataFileError(
            "--mask needs vectors in pixels to find them in the image, got "
            f"{length_unit or 'no unit'}: export them without calibration, give --length-unit px "
            "if they are in pixels, or use the mask of the PIV program"
        )
    files = expand([pattern])
    n_frames = fields.t.size
    if len(files) not in (1, n_frames):
        raise DataFileError(
            f"--mask must be one image or one for each of the {n_frames} frames, got {len(files)}"
        )
    masks = []
    for file in files:
        try:
            with Image.open(file) as image:
                picture = np.asarray(image.convert("L"), np.float64)
        except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError) as error:
            raise DataFileError(f"{file} cannot be read as an image: {error}") from None
        masks.append(_at_vectors(file, picture, fields))
    outside = ~np.broadcast_to(np.stack(masks), fields.u.shape)
    codes = np.where(outside, np.int8(Validity.MASKED), fields.validity)
    u, v = (np.where(outside, np.nan, a) for a in (fields.u, fields.v))
    return replace(fields, validity=codes, u=u, v=v)


def _at_vectors(file: Path, picture: Float64, fields: VectorFields) -> Bool:
    rows, columns = (np.rint(axis).astype(int) for axis in (fields.y, fields.x))
    if fields.y_down is False:
        rows = picture.shape[0] - 1 - rows
    for name, index, size in (("y", rows, picture.shape[0]), ("x", columns, picture.shape[1])):
        if index.min() < 0 or index.max() > size:
            raise DataFileError(
                f"{file} must cover the vectors, got {size} pixels along {name} and vectors at "
                f"{index.min()} to {index.max()}: use the mask of the same camera"
            )
    rows, columns = (
        np.minimum(i, n - 1) for i, n in zip((rows, columns), picture.shape, strict=True)
    )
    bright = picture > _BRIGHT * picture.max()
    return np.asarray(bright[np.ix_(rows, columns)])


def below_line(fields: VectorFields, t: Float64, x: Float64, y: Float64) -> Bool:
    """Cells [T, Y, X] below a line of points; each frame has the points nearest in time."""
    inside = np.zeros(fields.u.shape, bool)
    times = np.unique(t)
    for k, now in enumerate(fields.t):
        near = t == times[np.argmin(np.abs(times - now))]
        order = np.argsort(x[near], kind="stable")
        line = np.interp(fields.x, x[near][order], y[near][order], -np.inf, -np.inf)
        inside[k] = fields.y[:, None] <= line
    return inside
