"""What the grains do at walls: points of a wall with the velocity that grains have there.

Grains never flow through a wall: the velocity normal to the wall is that of the wall. If they do
not slip, the velocity along the wall is that of the wall too; else it is that of the vectors beside
the wall, extrapolated. So every point of a wall is a velocity in the training, like a vector.

The vectors have the last word. A straight line through the vectors around a point gives the
velocity on the wall, with its standard error. Means over windows that touch a wall, rough walls of
loose grains, or a wall in the wrong place contradict a condition: then it is left out, with a
warning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64, Index
from granpinn.data.flow import Flow, Walls
from granpinn.data.walls import Segments, crossed, samples, segments_of
from granpinn.errors import warn
from granpinn.physics.terms import TERMS

REACH = 1.5  # spacings from a wall to the nearest vector of grains that touch it
NEAR, NEAREST = 24, 12  # vectors of a fit, and of the one that shows its error
WIDE = 4.0  # spacings to the farthest vector of a fit
FEWEST = 6  # vectors of a fit
TINY = np.finfo(float).tiny
SURE = 3.0  # standard errors
TOLERANCE = TERMS[0].sigma  # of the rms speed: less is nothing to a training
PLACE = 0.25  # spacings by which the place of a wall may be wrong


class Touch(NamedTuple):
    """Where grains touch walls, and the conditions there that the vectors do not contradict.

    All have n rows, in units of the file.

    Attributes:
        point: x, y, t [n, 3].
        wall: number of the wall of each [n].
        stated: whether the file states that grains do not slip there [n].
        p: known normal stress [n], or NaN.
        closed: whether no grains flow through the wall [n].
        sticks: whether they move with it [n].
        target: velocity of the grains on the wall [n, 2]; NaN where no condition is used.
    """

    point: Float64
    wall: Index
    stated: Bool
    p: Float64
    closed: Bool
    sticks: Bool
    target: Float64


def _touch(flow: Flow, segments: Segments) -> Touch:
    """The points of walls that grains touch, at the times of all frames."""
    spacing = max(flow.spacing)
    k, part = samples(segments, spacing)
    frames = np.flatnonzero(flow.after_start(flow.t))
    parts = [_touch_in(flow, int(frame), segments, k, part, spacing) for frame in frames]
    return Touch(*map(np.concatenate, zip(*parts, strict=True)))


def _touch_in(
    flow: Flow, frame: int, segments: Segments, k: Index, part: Float64, spacing: float
) -> Touch:
    """The points of a frame; its numbers of segments and places on them are of all points [n]."""
    rows, columns = np.nonzero(flow.valid_in(frame))
    place = np.stack([flow.x[columns], flow.y[rows]], 1)
    velocities = np.stack([a[frame][rows, columns] for a in (flow.u, flow.v)], 1).astype(np.float64)
    speed = np.sqrt(np.mean(np.square(velocities).sum(axis=1)))
    point = _between(segments.ends[k], part)
    distance, nearest = scipy.spatial.cKDTree(place).query(point, k=NEAR)
    nearest = np.minimum(nearest, len(place) - 1)  # infinitely far where there are fewer
    step = place[nearest] - point[:, None]
    wet = distance[:, 0] <= REACH * spacing
    wet[wet] = ~crossed(point[wet], point[wet] + step[wet, 0], segments)
    k, part, point, step, distance = (a[wet] for a in (k, part, point, step, distance))
    vectors = velocities[nearest[wet]]
    normal = _between(segments.normal[k], part)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    side = np.einsum("nkc,nc->nk", step, normal)
    near = (side * side[:, :1] > 0) & (distance <= WIDE * spacing)
    scale = max(float(np.abs(step).max(initial=0.0)), TINY)
    of_grains, slope, error = _fit(step, vectors, near, scale)
    closer = near.copy()
    closer[:, NEAREST:] = False
    other, _, _ = _fit(step, vectors, closer, scale)
    change = np.abs(np.einsum("nic,ni->nc", slope, normal)) * (PLACE * spacing)
    least = TOLERANCE * speed
    error = np.sqrt((SURE * error) ** 2 + (of_grains - other) ** 2 + change**2 + least**2)
    velocity, stated = _between(segments.velocity[k], part), segments.sticks[k]
    unknown, off = ~np.isfinite(of_grains).all(axis=1), of_grains - velocity

    def agrees(direction: Float64) -> Bool:
        size = np.abs(np.sum(off * direction, axis=1))
        return np.asarray(unknown | (size <= np.linalg.norm(error * direction, axis=1)))

    closed = agrees(normal)
    sticks = stated & closed & agrees(np.stack([-normal[:, 1], normal[:, 0]], 1))
    through = np.sum(off * normal, axis=1)[:, None] * normal
    target = np.where(sticks[:, None], velocity, of_grains - through)
    return Touch(
        point=np.column_stack([point, np.full(len(point), flow.t[frame])]),
        wall=segments.wall[k],
        stated=stated,
        p=_between(segments.p[k], part),
        closed=closed,
        sticks=sticks,
        target=np.where(closed[:, None], target, np.nan),
    )


def _between(ends: Float64, part: Float64) -> Float64:
    """Values at places between the two ends of segments, [n, 2, ...] and [n]."""
    part = part.reshape(-1, *([1] * (ends.ndim - 2)))
    return np.asarray((1 - part) * ends[:, 0] + part * ends[:, 1])


def _fit(
    step: Float64, vectors: Float64, near: Bool, scale: float
) -> tuple[Float64, Float64, Float64]:
    """Planes through vectors: value and its standard error at step 0 [n, 2], slopes [n, 2, 2].

    Args:
        step: from the point to its vectors [n, k, 2].
        vectors: [n, k, 2].
        near: which of them count [n, k].
        scale: size of the steps; it decides which directions the vectors fix.
    """
    one = np.ones((*near.shape, 1))
    X = np.concatenate([one, step / scale], axis=2) * near[..., None]
    Y = np.where(near[..., None], vectors, 0.0)
    inverse = np.linalg.pinv(X.swapaxes(1, 2) @ X, rcond=1e-9, hermitian=True)
    values = inverse @ (X.swapaxes(1, 2) @ Y)  # [n, 3, 2]
    rest = np.sum((Y - X @ values) ** 2, axis=1)
    count = near.sum(axis=1)
    variance = rest / np.maximum(count - 3, 1)[:, None]
    error = np.sqrt(variance * inverse[:, 0, :1])
    few = count < FEWEST
    return np.where(few[:, None], np.nan, values[:, 0]), values[:, 1:] / scale, error


@dataclass(frozen=True)
class WallFacts:
    """One wall, as the vectors beside it show it.

    Attributes:
        name: the wall in words.
        points: at which grains touch it, over all times.
        stated: whether the file states no slip anywhere on it.
        sticks: share of the points stated to be without slip whose vectors do not contradict.
        closed: share of the points where the vectors do not flow through it.
        pressure: mean of the known normal stress on it, or None.
    """

    name: str
    points: int
    stated: bool
    sticks: float
    closed: float
    pressure: float | None

    def __str__(self) -> str:
        kind = "no slip" if self.stated else "slip"
        if self.points == 0:
            return f"{self.name}: no grains touch it"
        text = f"{self.name}: {kind}, grains touch it at {self.points} points"
        return text + (f", pressure {self.pressure:.3g}" if self.pressure is not None else "")


MOST_WARNINGS = 8
LEAST_AGREEMENT = 0.9  # of the points of a wall, below which a condition is warned of


def walls_of(flow: Flow, walls: Walls) -> tuple[Touch, list[WallFacts]]:
    """Points of walls that grains touch, and the facts of each wall."""
    segments = segments_of(walls)
    touch, names = _touch(flow, segments), segments.names()

    def mean(values: Bool | Float64, known: Bool, otherwise: float) -> Float64:
        """Of the known values at each wall."""
        count = np.bincount(touch.wall[known], minlength=len(names))
        total = np.bincount(touch.wall[known], values[known], len(names))
        unknown = np.full(len(names), otherwise)
        return np.asarray(np.divide(total, count, out=unknown, where=count > 0))

    everywhere = np.ones(len(touch.wall), bool)
    points = np.bincount(touch.wall, minlength=len(names))
    stated = np.bincount(segments.wall, segments.sticks, minlength=len(names)) > 0
    sticks = mean(touch.sticks, touch.stated, 1.0)
    closed = mean(touch.closed, everywhere, 1.0)
    pressure = mean(touch.p, np.isfinite(touch.p), np.nan)
    known: list[Any] = [a.tolist() for a in (points, stated, sticks, closed)]
    load = [None if np.isnan(p) else p for p in pressure.tolist()]
    return touch, list(map(WallFacts, names, *known, load))


def contradictions(facts: Sequence[WallFacts]) -> list[str]:
    """The conditions that the vectors contradict, one sentence each."""
    found = []
    for wall in facts:
        if wall.closed < LEAST_AGREEMENT:
            found.append(
                f"grains flow through {wall.name} at {1 - wall.closed:.0%} of the points where "
                "they touch it: check its place and its velocity; it is no wall there in the "
                "training"
            )
        elif wall.sticks < LEAST_AGREEMENT:
            found.append(
                f"grains slip along {wall.name} at {1 - wall.sticks:.0%} of the points where the "
                "file states no slip: there the training only lets no grains through"
            )
    return found


def warn_of_contradictions(facts: Sequence[WallFacts]) -> None:
    """Warns of the first walls that the vectors contradict, and says how many more there are."""
    sentences = contradictions(facts)
    for sentence in sentences[:MOST_WARNINGS]:
        warn(sentence)
    if (more := len(sentences) - MOST_WARNINGS) > 0:
        warn(f"the vectors contradict {more} more walls: granpinn inspect --json lists them")
