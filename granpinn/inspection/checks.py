"""Facts about the vectors without any model: numbers, gaps, motion between frames, gravity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.data import Flow
from granpinn.estimates.gradients import Gradients
from granpinn.estimates.robust import quantiles
from granpinn.estimates.view import View

# Between two frames the fastest grains should move less than this, in units of H0: the shear
# layers of a collapse are about ten times thicker.
LARGEST_MOVE = 0.05
FASTEST = 0.99  # quantile
# Accelerations are averaged over blocks of so many frames, rows and columns. Blocks with a larger
# error, in units of |g|, are left out.
BLOCK = (12, 8, 8)
FEWEST_BLOCKS = 10
LARGEST_ERROR = 0.1
FALLING = 0.8  # of the largest acceleration
# Largest acceleration of a flow in which grains fall freely, in units of |g|.
FREE_FALL = (0.85, 1.2)
NEGLIGIBLE_NOISE = 1e-4  # of the largest speed


@dataclass(frozen=True)
class Counts:
    """Vectors and gaps.

    Attributes:
        frames, rows, columns: of the grid; for particles, of their view on a grid.
        vectors: number of valid vectors.
        invalid_share: share of the cells full of grains that have no vector; None for particles.
        zero_share: share of the vectors after t = 0 that are exactly zero.
        repeated: frames that are equal to the frame before.
        poor_frames: frames without vectors in half of the grains.
    """

    particles: bool
    frames: int
    rows: int
    columns: int
    vectors: int
    invalid_share: float | None
    zero_share: float
    repeated: tuple[int, ...]
    poor_frames: tuple[int, ...]


@dataclass(frozen=True)
class Motion:
    """Motion between frames, and acceleration against gravity; in units of H0 and |g|.

    Attributes:
        speed: largest speed, in the units of the file.
        cells_per_frame: distance of the fastest grains from one frame to the next, in cells; None
            for a steady flow, whose frames need not follow each other.
        largest_move: the same distance in units of H0, for the worst pair of frames, or None.
        sparse: (start, end) of the longest run of frames too far apart, in the units of the file.
        acceleration: largest (98 %) along gravity; None if noise hides it.
        tilt: degrees from gravity to the acceleration of falling grains, counter-clockwise.
    """

    speed: float
    cells_per_frame: float | None
    largest_move: float | None
    sparse: tuple[float, float] | None
    acceleration: float | None
    tilt: float | None


def counts(flow: Flow, view: View) -> Counts:
    """Numbers of vectors, gaps, zeros and repetitions."""
    particles = flow.particles
    if particles is None:
        later = view.there & flow.after_start(flow.t)[:, None, None]
        u, v = view.u[later], view.v[later]
        grains = int(view.grains.sum())
        invalid = 1 - int(view.there.sum()) / grains
        shares = view.there.sum((1, 2)) / np.maximum(view.grains.sum((1, 2)), 1)
        poor = tuple(map(int, np.flatnonzero(shares < 0.5)))
    else:
        later = flow.after_start(particles.t)
        u, v = (a[later].astype(np.float64) for a in (particles.u, particles.v))
        invalid, poor = None, ()
    zero = int(((u == 0) & (v == 0)).sum())
    return Counts(
        particles=particles is not None,
        frames=view.t.size if particles is None else int(np.unique(particles.t).size),
        rows=view.y.size,
        columns=view.x.size,
        vectors=int(view.count.sum()),
        invalid_share=invalid,
        zero_share=zero / max(u.size, 1),
        repeated=_repeated(view),
        poor_frames=poor,
    )


def _repeated(view: View) -> tuple[int, ...]:
    """Frames with the same vectors as the frame before, unless all are zero."""
    same = np.logical_and.reduce(
        [(a[1:] == a[:-1]).all(axis=(1, 2)) for a in (view.u, view.v, view.count)]
    )
    moves = (((view.u != 0) | (view.v != 0)) & view.there).any(axis=(1, 2))
    return tuple(map(int, np.flatnonzero(same & moves[1:]) + 1))


def motion(flow: Flow, view: View, found: Gradients, speed: float) -> Motion:
    """Distance of grains from frame to frame, and their acceleration.

    Args:
        speed: largest speed in the units of the file.
    """
    acceleration, tilt = _falling(view, found)
    if view.steady:
        return Motion(speed, None, None, None, acceleration, tilt)
    # Of the smoothed velocity: that of single vectors contains noise.
    size = np.hypot(found.u, found.v)
    fastest = quantiles(size, found.index[0], view.t.size, FASTEST)
    moves = np.diff(view.t) * np.maximum(fastest[1:], fastest[:-1])
    cell = min(view.steps[1:])
    return Motion(
        speed=speed,
        cells_per_frame=float(np.quantile(moves, FASTEST) / cell),
        largest_move=float(moves.max()),
        sparse=_longest_run(moves > LARGEST_MOVE, flow.t),
        acceleration=acceleration,
        tilt=tilt,
    )


def _longest_run(marked: Bool, t: Float64) -> tuple[float, float] | None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(int), [0]])))
    if edges.size == 0:
        return None
    start, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda run: run[1] - run[0])
    return float(t[start]), float(t[end])


def _falling(view: View, found: Gradients) -> tuple[float | None, float | None]:
    """Largest acceleration along gravity, and the direction of the grains that fall.

    Accelerations are averaged over blocks, within which windows overlap.
    """
    shape = [-(-n // size) for n, size in zip(view.count.shape, BLOCK, strict=True)]
    block = np.ravel_multi_index(
        [i // size for i, size in zip(found.index, BLOCK, strict=True)], shape
    )
    n = np.bincount(block, minlength=math.prod(shape))
    full = n >= math.prod(BLOCK) / 4

    def means(values: Float64) -> Float64:
        return np.asarray(np.bincount(block, weights=values, minlength=n.size)[full] / n[full])

    variance = found.sd[:, 0] ** 2 + (found.u * found.sd[:, 2]) ** 2
    variance += (found.v * found.sd[:, 1]) ** 2
    independent = np.maximum(n[full] / (2 * found.half_width + 1) ** 3, 1.0)
    sure = np.sqrt(means(variance) / independent) < LARGEST_ERROR
    if sure.sum() < FEWEST_BLOCKS:
        return None, None
    a = np.stack([means(values)[sure] for values in found.acceleration.T], axis=-1)
    g_x, g_y = view.gravity
    along = a @ np.array([g_x, g_y])
    largest = float(np.quantile(along, 0.98))
    falls = along > FALLING * largest
    if largest < 0.1:
        return largest, None
    x, y = np.median(a[falls], axis=0)
    return largest, math.degrees(math.atan2(g_x * y - g_y * x, g_x * x + g_y * y))
