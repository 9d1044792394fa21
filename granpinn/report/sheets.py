"""The sheet of the film: all frames as one PNG with a palette.

Of the 256 colours, 255 are the scale. The last one is places without grains: transparent.
"""

from __future__ import annotations

import base64
import io
import math

import numpy as np
from matplotlib import colormaps
from PIL import Image

from granpinn.arrays import Bool, Bytes, Floats
from granpinn.figures.style import VALUE_MAP

LEVELS = 255  # colours of the scale
OUTSIDE = 255


def quantise(values: Floats, low: float, high: float) -> Bytes:
    """Palette indices 0..254 of values between `low` and `high`; 255 where there is none."""
    known = np.isfinite(values)
    share = (np.clip(np.where(known, values, low), low, high) - low) / (high - low)
    return np.where(known, np.rint(share * (LEVELS - 1)), OUTSIDE).astype(np.uint8)


def palette() -> Bytes:
    """Colours [256, 3] of the indices: the scale, no grains."""
    colors = colormaps[VALUE_MAP](np.linspace(0, 1, LEVELS))[:, :3]
    return np.asarray(np.rint(255 * np.concatenate([colors, [(1, 1, 1)]])), np.uint8)


def columns_of(frames: int, height: int, width: int) -> int:
    """How many frames stand side by side, so that the sheet is about square."""
    return min(frames, max(1, round(math.sqrt(frames * height / width))))


def laid_out(pictures: Bytes, columns: int) -> Bytes:
    """One picture of frames [T, H, W], row by row: frame k is in row k // columns."""
    frames, height, width = pictures.shape
    rows = -(-frames // columns)
    sheet = np.full((rows * columns, height, width), OUTSIDE, np.uint8)
    sheet[:frames] = pictures
    ordered = sheet.reshape(rows, columns, height, width).swapaxes(1, 2)
    return ordered.reshape(rows * height, columns * width)


def indexed_png(indices: Bytes) -> str:
    """The picture of palette indices [H, W] as a PNG in base64."""
    image = Image.fromarray(indices)
    image.putpalette(palette().tobytes())
    return _base64(image, transparency=OUTSIDE)


def mask_png(shown: Bool, color: tuple[int, int, int]) -> str:
    """A PNG in base64 of one colour where `shown` [H, W], transparent elsewhere."""
    image = Image.fromarray(np.where(shown, 0, 1).astype(np.uint8))
    image.putpalette([*color, 255, 255, 255])
    return _base64(image, transparency=1)


def _base64(image: Image.Image, transparency: int) -> str:
    memory = io.BytesIO()
    image.save(memory, format="PNG", transparency=transparency, optimize=True)
    return base64.b64encode(memory.getvalue()).decode("ascii")
