"""Walls as straight segments: which of them are there at a time, and what they separate."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from granpinn.arrays import Bool, Float64, Index
from granpinn.data.flow import Walls

SMOOTH = 0.85  # cosine of the largest turn between segments of a curved wall
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
        p, tau: known normal and shear stress at the points [K, 2], or NaN.
        t: the time of the segment [K], NaN = at all times.
        wall: number of its wall [K]. Pieces of different times in the same order are one wall.
    """

    ends: Float64
    velocity: Float64
    normal: Float64
    sticks: Bool
    p: Float64
    tau: Float64
    t: Float64
    wall: Index

    def some(self, k: Bool) -> Segments:
        """The segments that `k` [K] chooses."""
        return Segments(**{name: values[k] for name, values in vars(self).items()})

    def at(self, time: float) -> Segments:
        """The segments that are there at a time: of those with a time, those of the nearest."""
        known = self.t[np.isfinite(self.t)]
        if known.size == 0:
            return self
        nearest = known[np.argmin(np.abs(known - time))]
        return self.some(np.isnan(self.t) | (self.t == nearest))

    @property
    def length(self) -> Float64:
        """[K]."""
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))

    def name(self, wall: int) -> str:
        """A wall in words, by its first and its last point."""
        own = self.ends[self.wall == wall]
        (x_0, y_0), (x_1, y_1) = own[0, 0], own[-1, 1]
        if _same(own[0, 0], own[-1, 1], float(np.ptp(own, axis=(0, 1)).max())):
            return f"the closed wall through ({x_0:.4g}, {y_0:.4g})"
        return f"the wall from ({x_0:.4g}, {y_0:.4g}) to ({x_1:.4g}, {y_1:.4g})"


def segments_of(walls: Walls) -> Segments:
    """The segments of walls that keep the rules of the format; points that repeat are left out."""
    m = walls.x.size
    place = np.stack([walls.x, walls.y], 1).astype(np.float64)
    zero, unknown = np.zeros(m), np.full(m, np.nan)
    velocity = np.stack([zero if a is None else a for a in (walls.u, walls.v)], 1)
    t = unknown if walls.t is None else walls.t
    sticks = zero if walls.slip is None else 1.0 - walls.slip
    p, tau = (unknown if a is None else a.astype(np.float64) for a in (walls.p, walls.tau))
    parts = np.isnan(walls.x)
    edges = np.flatnonzero(np.concatenate([[True], parts, [True]]))
    pieces = [slice(a, b - 1) for a, b in pairwise(edges) if b - a > 1]
    found: list[list[np.ndarray]] = []
    order: dict[float, int] = {}
    for own in pieces:
        keep = np.flatnonzero(np.append(True, np.any(np.diff(place[own], axis=0) != 0, axis=1)))
        k = keep + own.start
        if len(k) < 2:
            continue
        time = float(t[k[0]]) if np.isfinite(t[k[0]]) else np.inf  # NaN is not equal to itself
        number = order.setdefault(time, 0)
        order[time] += 1
        pair = np.stack([k[:-1], k[1:]], 1)
        found.append(
            [
                place[pair],
                velocity[pair],
                _normals(place[k]),
                np.asarray((sticks[pair] > 0).all(axis=1)),
                p[pair],
                tau[pair],
                t[k[:-1]],
                np.full(len(pair), number),
            ]
        )
    # A wall that moves is another one than those that stay.
    stay = order.get(np.inf, 0)
    for part in found:
        part[-1] = part[-1] + (stay if np.isfinite(part[-2][0]) else 0)
    return Segments(*(np.concatenate(a) for a in zip(*found, strict=True)))


def _normals(place: Float64) -> Float64:
    """Unit normals at both ends of the segments between the points [n, 2]: [n - 1, 2, 2]."""
    along = np.diff(place, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    before, after = np.roll(along, 1, axis=0), np.roll(along, -1, axis=0)
    if not _same(place[0], place[-1], float(np.ptp(place, axis=0).max())):
        before[0], after[-1] = along[0], along[-1]
    ends = []
    for other in (before, after):
        smooth = np.sum(along * other, axis=1, keepdims=True) > SMOOTH
        mean = along + np.where(smooth, other, along)
        ends.append(mean / np.linalg.norm(mean, axis=1, keepdims=True))
    x, y = np.stack(ends, 1)[..., 0], np.stack(ends, 1)[..., 1]
    return np.stack([-y, x], -1)


def _same(a: Float64, b: Float64, extent: float) -> bool:
    return bool(np.abs(a - b).max() <= ON_WALL * extent)


def crossed(start: Float64, end: Float64, segments: Segments) -> Bool:
    """Which of the straight paths from `start` [n, 2] to `end` [n, 2] cross a wall.

    A path that only begins or ends on a wall does not cross it.
    """
    found = np.zeros(len(start), bool)
    if len(start) == 0 or len(segments.t) == 0:
        return found
    low, high = np.minimum(start, end), np.maximum(start, end)
    extent = float(np.ptp(np.concatenate([low, high]), axis=0).max())
    nearly = ON_WALL * max(extent, float(np.ptp(segments.ends, axis=(0, 1)).max()))
    for a, b in segments.ends:
        near = ((high >= np.minimum(a, b)) & (low <= np.maximum(a, b))).all(axis=1) & ~found
        k = np.flatnonzero(near)
        if k.size == 0:
            continue
        along = (b - a) / np.linalg.norm(b - a)
        one, two = (_cross(along, path[k] - a) for path in (start, end))
        apart = (np.minimum(one, two) < -nearly) & (np.maximum(one, two) > nearly)
        step = end[k] - start[k]
        first, last = _cross(step, a - start[k]), _cross(step, b - start[k])
        found[k] = apart & (first * last <= 0)
    return found


def parted(start: Float64, end: Float64, t: Float64, segments: Segments) -> Bool:
    """Which of the paths [n, 2], each at a time [n], cross a wall that is there then.

    A path without an end (NaN) crosses none.
    """
    found = np.zeros(len(start), bool)
    known = np.isfinite(end).all(axis=1)
    for time in np.unique(t[known]):
        k = np.flatnonzero(known & (t == time))
        found[k] = crossed(start[k], end[k], segments.at(float(time)))
    return found


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
