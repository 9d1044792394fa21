r"""The noise of the vectors, from the vectors alone.

On a grid: third differences of one cell in time. A parabola over four frames cancels, and so does
the acceleration of the flow. White noise of standard deviation $\sigma$ becomes
$\sqrt{20}\,\sigma$. The estimate is a median, so that fronts and shear bands, where the flow
changes within four frames, do not matter. The correlation of differences in time between
neighboring cells gives the number of independent vectors.

Where most of these differences are missing, as they cross gaps, both come from pairs of vectors
(`pairs.py`), and so they do for particles.

In one frame, such as the mean of a steady flow, the estimate takes third differences in x and y (a
factor 20), and every vector counts as independent.

This is the noise of a typical vector. A few bad ones hardly change the median: where the worst
hundredth of the vectors of a PIV has half of the variance, the root mean square is nearly twice as
large (docs/guides/inspecting.md). Errors that are the same in every frame, such as means over
windows, cancel. What stays the same for a few frames cancels in part: differences of every third
frame show up to 1.7 times the noise in grains (bench/studies/noise/note.md).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from granpinn.arrays import Float64, Int8
from granpinn.estimates.pairs import pair_noise
from granpinn.estimates.robust import LEAST_CORRELATION, correlation, robust_sd, signs_of
from granpinn.estimates.view import View

ORDER = 3
FARTHEST = 4  # cells at which correlation is looked for
LEAST_SHARE = 0.5  # of the differences in time that a flow without gaps has


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one component of one vector, in any units; None if unknown.

    Attributes:
        sigma: of a typical vector.
        u, v: for each component alone.
        vectors_per_independent: number of vectors over number of independent ones.
    """

    sigma: float | None
    u: float | None
    v: float | None
    vectors_per_independent: float

    def at_least(self, sigma: float) -> Noise:
        """The same with standard deviations of at least `sigma`, which differences do not show."""
        known = {name: getattr(self, name) for name in ("sigma", "u", "v") if sigma > 0}
        return dataclasses.replace(self, **{k: max(s or 0.0, sigma) for k, s in known.items()})

    def in_units_of(self, unit: float) -> Noise:
        """The same in units that are `unit` times smaller."""
        known = {name: s for name, s in vars(self).items() if name != "vectors_per_independent"}
        made: dict[str, Any] = {n: None if s is None else s * unit for n, s in known.items()}
        return dataclasses.replace(self, **made)


def grid_noise(view: View) -> Noise:
    """The noise of vectors on a grid."""
    pair = [np.where(view.there, values, np.nan) for values in (view.u, view.v)]
    in_time = [np.diff(values, ORDER, axis=0) for values in pair]
    factor = _growth(ORDER)
    chosen = [_spread(values, factor) for values in in_time]
    if None in chosen:
        in_space = (np.diff(np.diff(a, ORDER, axis=1), ORDER, axis=2) for a in pair)
        chosen = [_spread(values, factor**2) for values in in_space]
    found = Noise(
        sigma=_rms(chosen),
        u=chosen[0],
        v=chosen[1],
        vectors_per_independent=_per_independent(in_time),
    )
    if not _gaps(view, in_time[0]):
        return found
    k, j, i = np.nonzero(view.there)
    return of_pairs(found, view.t[k], view.x[i], view.y[j], view.u[k, j, i], view.v[k, j, i])


def of_pairs(found: Noise, t: Float64, x: Float64, y: Float64, u: Float64, v: Float64) -> Noise:
    """The noise from pairs of the vectors, all [N]; `found` if these or the frames are too few."""
    pairs = pair_noise(t, x, y, u, v)
    if pairs is None:
        return found
    sigma = _rms([pairs.u, pairs.v])
    return dataclasses.replace(found, sigma=sigma, **vars(pairs))


def _gaps(view: View, in_time: Float64) -> bool:
    """Whether most of the differences in time are missing, as they cross gaps."""
    frames = len(view.t)
    whole = view.there.sum() * max(0, frames - ORDER) / frames
    return bool(np.isfinite(in_time).sum() < LEAST_SHARE * whole)


def _growth(order: int) -> float:
    """Factor on the standard deviation of white noise in differences of an order."""
    return math.sqrt(math.comb(2 * order, order))


def _spread(values: Float64, factor: float) -> float | None:
    found = robust_sd(values)
    return None if found is None else found / factor


def _rms(pair: Sequence[float | None]) -> float | None:
    u, v = pair
    return None if u is None or v is None else math.sqrt((u * u + v * v) / 2)


def _per_independent(differences: list[Float64]) -> float:
    """Product over x and y of 1 + 2 (sum of the correlations at 1, 2, ... cells)."""
    signs = [signs_of(values) for values in differences]
    product = 1.0
    for axis in (1, 2):
        total = 1.0
        for lag in range(1, FARTHEST + 1):
            n = differences[0].shape[axis]
            if lag >= n:
                break
            shared = np.mean([_at_lag(values, axis, lag) for values in signs])
            if not shared > LEAST_CORRELATION:
                break
            total += 2 * float(shared)
        product *= total
    return product


def _at_lag(signs: Int8, axis: int, lag: int) -> float:
    """Of neighbors, from the signs of their differences."""
    ordered = np.moveaxis(signs, axis, 0)
    return correlation(ordered[:-lag] * ordered[lag:])
