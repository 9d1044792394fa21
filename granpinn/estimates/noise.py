r"""The noise of the vectors, from the vectors alone.

**On a grid**: third differences of one cell in time. A parabola over four frames cancels, and so
does the acceleration of the flow. White noise of standard deviation $\sigma$ becomes
$\sqrt{20}\,\sigma$. The estimate is a median, so that fronts and shear bands, where the flow
changes within four frames, do not matter. The correlation of differences in time between
neighboring cells gives the number of independent vectors. In one frame, such as the mean of a
steady flow, the estimate takes third differences in x and y (a factor 20), and every vector counts
as independent.

**With gaps**, where most of these differences are missing, and of particles: pairs of predictions.
Every vector is predicted from its nearest vectors in the frames 1, 3, 5, ... before and after its
own, and from those in the frames 2, 4, 6, ... Each prediction is a local parabola in x, y and t. No
vector is in both. So the two errors a and b of vector i share the error e_i of the vector itself,
and nothing else:

$$\overline{a_i b_j} = \overline{e_i e_j} = \sigma^2 \rho_{ij}$$

for two vectors i and j of one frame, and $\sigma^2$ for i = j. Means are taken of signs: for normal
deviates $\overline{\mathrm{sign}(a b)} = \frac{2}{\pi} \arcsin \mathrm{corr}(a, b)$. So a few bad
vectors do not matter. The number of vectors that share one error is $1 + \sum_k \rho_k$ over the
neighbors k = 1, 2, ... in the order of their distance, without any cell or length. The frames reach
farther as long as that makes sigma less: too long a parabola leaves more.

This is the noise of a typical vector. A few bad ones hardly change the median: where the worst
hundredth of the vectors of a PIV has half of the variance, the root mean square is nearly twice as
large (docs/guides/inspecting.md). Errors that are the same in every frame, such as means over
windows, cancel. What stays the same for a few frames cancels in part: differences of every third
frame show up to 1.7 times the noise in grains (bench/studies/noise/note.md). Errors that more than
MOST_PARTNERS neighbors share are seen in part.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from granpinn.arrays import Float64, Index, Int8
from granpinn.estimates.gradients import View
from granpinn.estimates.local_fits import quadratic_basis

FEWEST = 50  # values below which there is no estimate
NORMAL = 1.4826  # standard deviation over median absolute deviation of normal deviates
LEAST_CORRELATION = 0.05  # below this it is scatter


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


def robust_sd(values: Float64) -> float | None:
    """Standard deviation of the finite ones of normal deviates around 0; None if they are few."""
    finite = values[np.isfinite(values)]
    if finite.size < FEWEST:
        return None
    return float(NORMAL * np.median(np.abs(finite)))


def signs_of(values: Float64) -> Int8:
    """-1, 0 or 1 for each value; 0 for NaN."""
    return (values > 0).view(np.int8) - (values < 0).view(np.int8)


def correlation(signs: Int8) -> float:
    """Of two normal deviates, from the products of their signs; 0 if too few are not 0.

    The mean sign is 2/pi arcsin of the correlation.
    """
    known = int(np.count_nonzero(signs))
    if known < FEWEST:
        return 0.0
    mean = int(signs.sum(dtype=np.int64)) / known
    return math.sin(math.pi / 2 * mean)


NEIGHBORS = 24  # of a prediction, which has 10 coefficients
LEAST_REACH = 4  # frames: the even ones up to it are four, enough for a parabola in time
MOST_PARTNERS = 80  # neighbors at which correlation is looked for: those of a cell in 9 x 9 cells
FRAMES, SAMPLES = 60, 6000  # at most, spread over the flow
MOST_GAIN = 2.0  # variance of a prediction over that of its vectors; more is an extrapolation


@dataclass(frozen=True, eq=False)
class _Vectors:
    """Vectors of all frames: t [N], place [N, 2], velocity [N, 2], and the indices by frame."""

    t: Float64
    place: Float64
    velocity: Float64
    frames: list[Index]


@dataclass(frozen=True, eq=False)
class _Errors:
    """Errors of both predictions [2, S, 2], NaN where there is none; sigma [2]; corr(a, b) [2]."""

    both: Float64
    sigma: Float64
    shared: Float64


def pair_noise(t: Float64, x: Float64, y: Float64, u: Float64, v: Float64) -> Noise | None:
    """The noise of vectors in frames, all [N], in any units; None if vectors or frames are few."""
    order = np.argsort(t, kind="stable")
    frames = np.split(order, np.flatnonzero(np.diff(t[order])) + 1)
    data = _Vectors(t, np.stack([x, y], -1), np.stack([u, v], -1), frames)
    n = len(frames) - 2 * LEAST_REACH
    if n < 1 or t.size < 2 * len(frames):
        return None
    used = LEAST_REACH + np.unique(np.linspace(0, n - 1, min(n, FRAMES)).astype(int))
    patches = [_patch(data, k, SAMPLES // len(used)) for k in used]
    best, reach = None, LEAST_REACH
    while 2 * reach <= len(frames):
        found = _errors(data, used, patches, reach)
        if best is not None and (found is None or not _less(found, best)):
            break
        best, reach = found, 2 * reach
    if best is None:
        return None
    partners = [_partners(data, k, patch) for k, patch in zip(used, patches, strict=True)]
    u_sigma, v_sigma = map(float, best.sigma)
    return Noise(_rms([u_sigma, v_sigma]), u_sigma, v_sigma, _sharing(best, partners))


def _less(found: _Errors, best: _Errors) -> bool:
    """Whether the noise is smaller, by more than the standard error of a squared median."""
    part = 1 - 2.3 / math.sqrt(found.both.shape[1])
    return bool(np.sum(found.sigma**2) < part * np.sum(best.sigma**2))


def _patch(data: _Vectors, k: int, size: int) -> Index:
    """So many vectors of frame k around one of them, or all of a small frame."""
    own = data.frames[k]
    if own.size <= size:
        return own
    place = data.place[own]
    middle = place[np.random.default_rng(k).integers(own.size)]
    return own[np.argsort(np.sum((place - middle) ** 2, axis=1), kind="stable")[:size]]


def _errors(data: _Vectors, used: Index, patches: list[Index], reach: int) -> _Errors | None:
    """Of all patches, from frames up to `reach` before and after; None if they are few."""
    parts = []
    for k, patch in zip(used, patches, strict=True):
        after = [np.arange(first, reach + 1, 2) for first in (1, 2)]
        near = [np.concatenate([k - steps, k + steps]) for steps in after]
        inside = [frames[(frames >= 0) & (frames < len(data.frames))] for frames in near]
        two = [_prediction(data, patch, [data.frames[j] for j in frames]) for frames in inside]
        parts.append(data.velocity[patch] - np.stack(two))
    both = np.concatenate(parts, axis=1)
    there = np.isfinite(both).all(axis=(0, 2))
    if there.sum() < FEWEST:
        return None
    sizes = NORMAL * np.median(np.abs(both[:, there]), axis=1)
    shared = np.array([correlation(signs_of(both[0, :, c] * both[1, :, c])) for c in (0, 1)])
    return _Errors(both, np.sqrt(np.maximum(shared, 0.0) * sizes[0] * sizes[1]), shared)


def _prediction(data: _Vectors, patch: Index, frames: list[Index]) -> Float64:
    """Velocity at the vectors of a patch [S, 2] from those of other frames; NaN where they fail."""
    place = data.place[patch]
    lower, upper = place.min(axis=0), place.max(axis=0)
    margin = upper - lower
    others = np.concatenate(frames)
    points = data.place[others]
    others = others[((points >= lower - margin) & (points <= upper + margin)).all(axis=1)]
    if others.size < NEIGHBORS:
        return np.full((patch.size, 2), np.nan)
    distance, found = scipy.spatial.cKDTree(data.place[others]).query(place, k=NEIGHBORS)
    near = others[found]
    size = np.maximum(distance[:, -1:], np.finfo(float).tiny)
    dx, dy = ((data.place[near, axis] - place[:, axis, None]) / size for axis in (0, 1))
    dt = data.t[near] - data.t[patch][:, None]
    basis = quadratic_basis([dx, dy, dt / np.abs(dt).max()])
    n = basis.shape[-1]
    normal = np.swapaxes(basis, 1, 2) @ basis
    normal += 1e-9 * np.eye(n) * np.trace(normal, axis1=1, axis2=2)[:, None, None]
    weights = np.einsum("skn,sn->sk", basis, np.linalg.solve(normal, np.eye(n)[:, :1])[..., 0])
    # Weights of a sum other than 1 do not keep a constant: the vectors do not fix a parabola.
    sound = (np.abs(weights.sum(axis=1) - 1) < 1e-3) & (np.sum(weights**2, axis=1) < MOST_GAIN)
    predicted = np.einsum("sk,skc->sc", weights, data.velocity[near])
    return np.where(sound[:, None], predicted, np.nan)


def _partners(data: _Vectors, k: int, patch: Index) -> Index:
    """Nearest vectors of the same frame, by distance: places in the patch [S, MOST_PARTNERS].

    -1 for a vector outside of the patch, -2 where the frame has no more.
    """
    own = data.frames[k]
    inside = np.full(own.size + 1, -2)
    inside[:-1] = -1
    inside[np.searchsorted(own, patch)] = np.arange(patch.size)
    wanted = MOST_PARTNERS + 1
    _, near = scipy.spatial.cKDTree(data.place[own]).query(
        data.place[patch], k=[*range(2, wanted + 1)]
    )
    return np.asarray(inside[near])


def _sharing(found: _Errors, partners: list[Index]) -> float:
    """1 + the sum of the correlations with all partners."""
    if not (found.shared > 0).all():
        return 1.0
    starts = np.cumsum([0, *(len(p) for p in partners[:-1])])
    near = np.concatenate(
        [np.where(p < 0, p, p + s) for p, s in zip(partners, starts, strict=True)]
    )
    total, first = 1.0, 0
    while first < MOST_PARTNERS:
        group = near[:, first : 2 * first + 1]
        shared = _of_group(found, group)
        if not shared > LEAST_CORRELATION:
            break
        total += shared * float((group > -2).sum(axis=1).mean())
        first = 2 * first + 1
    return total


def _of_group(found: _Errors, group: Index) -> float:
    """Mean correlation of the errors of vectors [S] with those of their partners [S, n]."""
    there = group >= 0
    mean = 0.0
    for c in (0, 1):
        a, b = found.both[..., c]
        products = np.concatenate([p[:, None] * q[group] for p, q in ((a, b), (b, a))])
        mean += correlation(signs_of(products[np.tile(there, (2, 1))])) / float(found.shared[c]) / 2
    return mean


ORDER = 3
FARTHEST = 4  # cells at which correlation is looked for
LEAST_SHARE = 0.5  # of the differences in time that a flow without gaps has


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
    return pair_noise(t, x, y, u, v) or found


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
