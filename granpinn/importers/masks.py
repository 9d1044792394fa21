"""Masks that are images: black where there are no grains."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Bool
from granpinn.importers.limits import open_file, require_room
from granpinn.importers.series import expand
from granpinn.importers.vectors import DataFileError, Validity, VectorFields

_BRIGHT = 0.5
_IMAGES = ("PNG", "TIFF", "BMP", "JPEG", "GIF", "PPM", "WEBP")
_MAX_IMAGE = 2**30  # bytes
_MAX_PIXELS = 2**27


def with_mask(fields: VectorFields, pattern: str, length_unit: str | None) -> VectorFields:
    """Masks the vectors where an image is black; one image for all frames or one for each.

    Black (below half of the brightest) means no grains. The coordinates of the vectors must be
    pixels, and y as in the image.
    """
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
    masks = [_at_vectors(file, _picture(file), fields) for file in files]
    outside = ~np.broadcast_to(np.stack(masks), fields.u.shape)
    codes = np.where(outside, np.int8(Validity.MASKED), fields.validity)
    return replace(fields, validity=codes)


def _picture(file: Path) -> Any:
    """The grey levels of an image of moderate size, in one of the formats of cameras and masks."""
    from PIL import Image, UnidentifiedImageError

    try:
        with open_file(file, _MAX_IMAGE) as stream, Image.open(stream, formats=_IMAGES) as image:
            require_room(image.width * image.height, 1, file)
            if image.width * image.height > _MAX_PIXELS:
                raise ValueError(f"{image.width} x {image.height} pixels are too many")
            if (count := getattr(image, "n_frames", 1)) > 1:
                raise ValueError(f"it holds {count} images, save each in a file")
            clear = image.has_transparency_data
            if clear and np.asarray(image.convert("RGBA"))[..., 3].min() < 255:
                raise ValueError("it is partly transparent, save it without transparency")
            # To 8 bits, convert cuts off what lies above 255.
            deep = image.mode in ("I", "F") or image.mode.startswith("I;16")
            return np.asarray(image if deep else image.convert("L"))
    except DataFileError:
        raise
    except Exception as error:  # of any kind, for damaged files
        reason = str(error)
        if isinstance(error, UnidentifiedImageError):  # its message names the stream
            reason = f"it is damaged, or none of {', '.join(_IMAGES)}"
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
    bright = picture > _BRIGHT * picture.max()
    return np.asarray(bright[np.ix_(rows, columns)])
