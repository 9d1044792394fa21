r"""The lattice of vectors that are multiples of one step, as peak locking leaves them.

A PIV program that finds displacements of whole pixels, or of halves or tenths, rounds every
component to a step q. Rounding adds an error with the standard deviation $q / \sqrt{12}$, which
differences in time do not show where neighbors are rounded alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.data import Flow

ROUNDING = 1 / math.sqrt(12)  # standard deviation of a rounding over its step
MAX_SCATTER = 0.05  # rms distance of the values from the lattice over its step; 0.29 without one
# Of the fastest component: distances of two levels are sought above one of these after the other.
# A rounding that is smaller than the last one does no harm.
GAPS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
FASTEST = 0.995  # quantile
REACH = (4, 16, 64, math.inf)  # levels: a first guess counts the far ones wrong
# Variance of third differences, as of white noise, over the squared step: 1/12 of a rounding.
ORDER, LEAST_ROUGHNESS = 3, 0.01
FRAMES = 8  # at most, spread over the flow
FEWEST_LEVELS, FEWEST_VALUES = 3, 50  # of a frame


def lattice_step(flow: Flow) -> float:
    """The step of which the velocities of most frames are multiples, in their unit; 0 without."""
    steps = [step for values in _frames(flow) if (step := _step(values)) is not None]
    return float(np.median(steps)) if steps else 0.0


def _frames(flow: Flow) -> Iterator[Floats]:
    """u and v of some frames, [2, n] or [2, Y, X] with NaN where there is no vector.

    One frame shows that vectors are rounded, and not that they change in even steps of time.
    """
    particles = flow.particles
    times = flow.t if particles is None else np.unique(particles.t)
    chosen = np.unique(np.linspace(0, times.size - 1, FRAMES).round().astype(int))
    for k in chosen:
        if particles is not None:
            now = particles.t == times[k]
            yield np.stack([particles.u[now], particles.v[now]])
        else:
            valid = flow.valid_in(np.array([k]))[0]
            yield np.where(valid, np.stack([flow.u[k], flow.v[k]]), np.nan)


def _step(found: Floats) -> float | None:
    """The step of one frame, 0 without; None for too few vectors that move."""
    moving = found[np.isfinite(found) & (found != 0)]
    values: Float64 = np.sort(np.abs(moving.astype(np.float64)))
    if values.size < FEWEST_VALUES:
        return None
    values = np.asarray(values[values <= np.quantile(values, FASTEST)])
    gaps = np.diff(values, prepend=0.0)
    for least in GAPS:
        between = gaps[gaps > least * values[-1]]
        step = float(np.median(between)) if between.size >= FEWEST_LEVELS else 0.0
        if step > 0 and (fitted := _fitted(values, step)) > 0 and _rough(found, fitted):
            return fitted
    return 0.0


def _rough(frame: Floats, step: float) -> bool:
    """Whether vectors on a grid jump as rounded ones do; those of an even shear do not."""
    if frame.ndim < 3:
        return True
    jumps = [np.diff(frame / step, ORDER, axis=axis) for axis in (1, 2)]
    known = [jump[np.isfinite(jump)] for jump in jumps]
    sizes = [float(np.mean(np.square(jump))) for jump in known if jump.size]
    return max(sizes, default=0.0) > math.comb(2 * ORDER, ORDER) * LEAST_ROUGHNESS


def _fitted(values: Float64, step: float) -> float:
    """The step by least squares from a first guess; 0 if the values scatter about its multiples."""
    for reach in REACH:
        near = values[values < (reach + 0.5) * step]
        levels = np.rint(near / step)
        if np.unique(levels[levels > 0]).size < FEWEST_LEVELS:
            return 0.0
        step = float((levels @ near) / (levels @ levels))
    scatter = float(np.sqrt(np.mean(np.square(values / step - np.rint(values / step)))))
    return step if scatter < MAX_SCATTER else 0.0
