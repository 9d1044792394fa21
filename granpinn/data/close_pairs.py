"""Pairs of straight lines that may cross, found on a grid of squares.

Lines are cut into pieces no longer than a square. A piece touches at most four squares, those of
the corners of its box. Lines with pieces in one square are a pair. So the work grows with the
number of lines and of close pairs, and not with the product of both numbers of lines.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from granpinn.arrays import Float64, Index, Int64

SQUARES = 1024  # along the longer side of all lines, at most
PIECES = 2**21  # of all lines, about, at most
BLOCK = 2**20  # pairs at once
SHORTER, ROUNDED = 0.99, 1e-6  # length of a piece, and rounding of its ends, in squares


def close_pairs(first: Float64, second: Float64) -> Iterator[tuple[Index, Index]]:
    """Numbers of a line of `first` [n, 2, 2] and of one of `second` [m, 2, 2], block by block.

    All pairs that cross are among them. A pair may come more than once.
    """
    if len(first) == 0 or len(second) == 0:
        return
    origin = np.minimum(first.min(axis=(0, 1)), second.min(axis=(0, 1)))
    extent = np.maximum(first.max(axis=(0, 1)), second.max(axis=(0, 1))) - origin
    lengths = [_length(lines) for lines in (first, second)]
    usual, total = min(float(np.median(a)) for a in lengths), sum(float(a.sum()) for a in lengths)
    side = max(2 * usual, float(extent.max()) / SQUARES, total / PIECES) or 1.0
    (line, square), (other, place) = (_squares(a - origin, side) for a in (first, second))
    taken = np.zeros(int(max(square.max(), place.max())) + 1, bool)
    taken[place] = True
    line, square = line[taken[square]], square[taken[square]]
    order = np.argsort(place, kind="stable")
    other, place = other[order], place[order]
    begin, end = (np.searchsorted(place, square, at) for at in ("left", "right"))
    count = end - begin
    reached = np.cumsum(count)
    start = 0
    while start < len(line):
        before = reached[start] - count[start]
        stop = max(start + 1, int(np.searchsorted(reached, before + BLOCK, "right")))
        n = count[start:stop]
        k = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n) + np.repeat(begin[start:stop], n)
        yield np.repeat(line[start:stop], n), other[k]
        start = stop


def _length(lines: Float64) -> Float64:
    """The longer side of the box of each line [n]."""
    return np.asarray(np.abs(lines[:, 1] - lines[:, 0]).max(axis=1))


def _squares(lines: Float64, side: float) -> tuple[Index, Int64]:
    """The squares [N] that lines [n, 2, 2] touch, as one number each, and the line of each [N]."""
    pieces = np.ceil(_length(lines) / (SHORTER * side)).astype(np.intp).clip(1)
    line = np.repeat(np.arange(len(lines)), pieces)
    k = np.arange(len(line)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    a, step = lines[:, 0], (lines[:, 1] - lines[:, 0]) / pieces[:, None]
    ends = np.stack([a[line] + step[line] * (k + i)[:, None] for i in (0, 1)]) / side
    low = np.floor(ends.min(axis=0) + 1 - ROUNDED).astype(np.int64)
    high = np.floor(ends.max(axis=0) + 1 + ROUNDED).astype(np.int64)
    wide, tall = (high > low).T
    every = np.ones_like(wide)
    corners = ((low, low, every), (high, low, wide), (low, high, tall), (high, high, wide & tall))
    kept = [(line[some], x[some, 0] + 2 * SQUARES * y[some, 1]) for x, y, some in corners]
    return np.concatenate([k for k, _ in kept]), np.concatenate([square for _, square in kept])
