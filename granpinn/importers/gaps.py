"""Sorts the gaps of a file without a mask into gaps inside the grains and outside."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import binary_fill_holes

from granpinn.arrays import Bool, Int8
from granpinn.data.particles import closed
from granpinn.importers.vectors import Validity

GAPS = "gaps"  # the fact "mask" of files whose mask this module makes


def split_gaps(measured: Bool) -> Int8:
    """Validity of every cell: VALID for a vector, INVALID for a gap inside, MASKED for one outside.

    A gap is inside if vectors enclose it, or if it is at most two cells wide.

    Args:
        measured: [T, Y, X].
    """
    codes = np.full(measured.shape, Validity.MASKED, np.int8)
    for code, frame in zip(codes, measured, strict=True):
        code[grains_around(frame)] = Validity.INVALID
        code[frame] = Validity.VALID
    return codes


def grains_around(measured: Bool) -> Any:
    """Cells [Y, X] with a vector or among vectors."""
    return binary_fill_holes(closed(measured))
