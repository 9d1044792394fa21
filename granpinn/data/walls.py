"""Walls as straight segments: and what they separate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64, Index
from granpinn.data.flow import Walls

SMOOTH = 0.85  # cosine of the largest turn between segments of a curved wall
PIECES = 2**21  # of all walls, about, at most
BLOCK = 2**14  # paths that are compared with walls at once
ON_WALL = 1e-9  # distance from a wall, over its extent, of a point that counts as on it


@dataclass(frozen=True, eq=False)
class Segments:
    """Straight segments of walls; the first axis of all arrays is that of the K segments.

    Attributes:
        ends: their two points [K, 2, 2]; the last axis is (x, y).
        velocity: of the wall at these points [K, 2, 2].
        normal: of the wall there, unit vectors [K, 2, 2], on its left. Those of a curved wall are
            the means of neighboring segments.
        sticks: whether grains move with the segment [K].
        p: known normal stress at the points [K, 2], or NaN.
        wall: number of its wall [K].
    """

    ends: Float64
    velocity: Float64
    normal: Float64
    sticks: Bool
    p: Float64
    wall: Index

    @property
    def length(self) -> Float64:
        """[K]."""
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))

    def names(self) -> list[str]:
        """Every wall in words, by its first and its last point."""
        ends, edges = self.ends, _edges(self.wall)
        found = zip(ends[edges[:-1], 0], ends[edges[1:] - 1, 1], _closed(ends, edges), strict=True)
        return [
            f"the closed wall through ({a[0]:.4g}, {a[1]:.4g})"
            if closed
            else f"the wall from ({a[0]:.4g}, {a[1]:.4g}) to ({b[0]:.4g}, {b[1]:.4g})"
            for a, b, closed in found
        ]


def segments_of(walls: Walls) -> Segments:
    """The segments of walls that keep the rules of the format; points that repeat are left out."""
    m = walls.x.size
    place = np.stack([walls.x, walls.y], 1).astype(np.float64)
    zero = np.zeros(m)
    velocity = np.stack([zero if a is None else a for a in (walls.u, walls.v)], 1)
    sticks = zero if walls.slip is None else 1.0 - walls.slip
    p = np.full(m, np.nan) if walls.p is None else walls.p.astype(np.float64)
    # A point that repeats the one before it is left out, and so is NaN, which parts two pieces.
    parts = np.isnan(walls.x)
    new = np.append(True, np.any(place[1:] != place[:-1], axis=1))
    k = np.flatnonzero(~parts & new)
    piece = np.cumsum(parts)[k]
    inside = piece[1:] == piece[:-1]
    pair = np.stack([k[:-1], k[1:]], 1)[inside]
    piece = np.unique(piece[1:][inside], return_inverse=True)[1]
    return Segments(
        place[pair],
        velocity[pair],
        _normals(place[pair], piece),
        np.asarray((sticks[pair] > 0).all(axis=1)),
        p[pair],
        piece,
    )


def _edges(number: Index) -> Index:
    """Where groups of equal numbers [K] begin, and K."""
    steps = np.flatnonzero(np.diff(number)) + 1
    return np.concatenate([[0], steps, [len(number)]])[: len(number) + 1]


def _normals(ends: Float64, piece: Index) -> Float64:
    """Unit normals at both ends of segments [K, 2, 2], which are those of pieces in order [K]."""
    along = ends[:, 1] - ends[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    edges = _edges(piece)
    first, last, closed = edges[:-1], edges[1:] - 1, _closed(ends, edges)
    before, behind = np.roll(along, 1, axis=0), np.roll(along, -1, axis=0)
    before[first] = along[np.where(closed, last, first)]
    behind[last] = along[np.where(closed, first, last)]
    normals = []
    for other in (before, behind):
        smooth = np.sum(along * other, axis=1, keepdims=True) > SMOOTH
        mean = along + np.where(smooth, other, along)
        normals.append(mean / np.linalg.norm(mean, axis=1, keepdims=True))
    x, y = np.moveaxis(np.stack(normals, 1), 2, 0)
    return np.stack([-y, x], -1)


def _closed(ends: Float64, edges: Index) -> Bool:
    """Whether groups of segments [K, 2, 2] end where they begin."""
    first, last = edges[:-1], edges[1:] - 1
    low = np.minimum.reduceat(ends.min(axis=1), first)
    extent = (np.maximum.reduceat(ends.max(axis=1), first) - low).max(axis=1)
    gap = np.abs(ends[first, 0] - ends[last, 1]).max(axis=1)
    return np.asarray(gap <= ON_WALL * extent)


def crossed(start: Float64, end: Float64, segments: Segments) -> Bool:
    """Which of the straight paths from `start` [n, 2] to `end` [n, 2] cross a wall.

    A path that only begins or ends on a wall does not cross it, nor does one without an end (NaN).
    """
    found = np.zeros(len(start), bool)
    end = np.where(np.isnan(end), start, end)
    low, high = np.minimum(start, end), np.maximum(start, end)
    walls = np.sort(segments.ends, axis=1)
    if len(start) == 0 or len(walls) == 0:
        return found
    extent = float(np.ptp(np.concatenate([low, high]), axis=0).max())
    nearly = ON_WALL * max(extent, float(np.ptp(segments.ends, axis=(0, 1)).max()))
    kept = (high >= walls[:, 0].min(axis=0)) & (low <= walls[:, 1].max(axis=0))
    kept = np.flatnonzero(kept.all(axis=1) & (start != end).any(axis=1))
    for k, s in _close(start[kept], end[kept], segments):
        k = kept[k]
        near = (high[k] >= walls[s, 0]) & (low[k] <= walls[s, 1])
        k, s = (a[near.all(axis=1) & ~found[k]] for a in (k, s))
        a, b = segments.ends[s].swapaxes(0, 1)
        along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
        one, two = (_cross(along, path[k] - a) for path in (start, end))
        apart = (np.minimum(one, two) < -nearly) & (np.maximum(one, two) > nearly)
        step = end[k] - start[k]
        first, last = _cross(step, a - start[k]), _cross(step, b - start[k])
        found[k[apart & (first * last <= 0)]] = True
    return found


def _close(start: Float64, end: Float64, segments: Segments) -> Iterator[tuple[Index, Index]]:
    """Numbers of paths and of segments near each other, block by block; all that cross are there.

    Segments are cut into pieces about as long as a path, so that pieces near the middle of a path
    are few.
    """
    if len(start) == 0:
        return
    reach = np.linalg.norm(end - start, axis=1) / 2
    side = max(2 * float(np.median(reach)), float(segments.length.sum()) / PIECES)
    count = np.ceil(segments.length / side).astype(np.intp).clip(1)
    owner = np.repeat(np.arange(len(count)), count)
    part = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[owner]
    a, b = segments.ends[owner].swapaxes(0, 1)
    tree = scipy.spatial.cKDTree(a + part[:, None] * (b - a))
    middle, far = (
        (start + end) / 2,
        (1 + 1e-6) * (reach + float(np.max(segments.length / count)) / 2),
    )
    for first in range(0, len(middle), BLOCK):
        some = slice(first, first + BLOCK)
        near = tree.query_ball_point(middle[some], far[some])
        size = np.fromiter(map(len, near), np.intp, len(near))
        pieces = np.fromiter(chain.from_iterable(near), np.intp, int(size.sum()))
        yield np.repeat(np.arange(first, first + len(near)), size), owner[pieces]


def _cross(a: Float64, b: Float64) -> Float64:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def samples(segments: Segments, spacing: float) -> tuple[Index, Float64]:
    """Points along the segments, about `spacing` apart: the segment [n], and the place on it [n].

    The place is 0 at the first end and 1 at the second. No point is at an end, where a corner of
    two walls may be. A wall of many short segments has a point on every n-th of them.
    """
    length = segments.length
    reached = np.cumsum(length)
    total = float(reached[-1]) if reached.size else 0.0
    count = int(np.ceil(total / spacing - 1e-6))
    at = (np.arange(count) + 0.5) * (total / max(count, 1))
    k = np.minimum(np.searchsorted(reached, at, side="left"), len(length) - 1)
    return np.asarray(k), np.asarray((at - reached[k] + length[k]) / length[k])
