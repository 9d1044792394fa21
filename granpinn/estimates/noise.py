r"""The noise of the vectors, from the vectors alone.

On a grid: third differences of one cell in time. A parabola over four frames cancels, and so does
the acceleration of the flow. White noise of standard deviation $\sigma$ becomes
$\sqrt{20}\,\sigma$. The estimate is a median, so that fronts and shear bands, where the flow
changes within four frames, do not matter. Third differences in x and y (a factor 20) are a second
estimate. It is smaller where the vectors of neighboring cells share pixels, and larger where cells
are wider than the shear layers. The correlation of differences in time between neighboring cells
gives the number of independent vectors.

In a steady flow the estimate is that in space, and every vector counts as independent: the frames
are means over a time in which the whole flow may drift, and a drift is no noise of vectors. First
differences in time, $\sqrt{2}\,\sigma$, show it. A flow of one frame has none.

This is the noise of a typical vector. A few bad ones hardly change the median: where the worst
hundredth of the vectors of a PIV has half of the variance, the root mean square is nearly twice as
large (docs/guides/inspecting.md). Errors that are the same in every frame, such as means over
windows, cancel.

For particles: residuals of local parabolas in x and y among the neighbors of one frame. The random
motion of grains about the mean flow counts as noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Float64, Index
from granpinn.data.flow import Particles
from granpinn.estimates.view import View
from granpinn.physics.scales import Scales

ORDER = 3
FEWEST = 50  # differences below which there is no estimate
NORMAL = 1.4826  # standard deviation over median absolute deviation of normal deviates
FARTHEST = 4  # cells at which correlation is looked for
LEAST_CORRELATION = 0.05  # below this it is scatter

NEIGHBORS = 24
SAMPLES = 4000
CHI2_MEDIAN = 2 / 9  # the median of chi^2/n is (1 - CHI2_MEDIAN/n)^3 to 1 % from n = 6 on


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one component of one vector, dimensionless; None if unknown.

    Attributes:
        sigma: the estimate for the inspection.
        u, v: for each component alone.
        in_time, in_space: from differences in time, and in x and y.
        vectors_per_independent: number of vectors over number of independent ones.
    """

    sigma: float | None
    u: float | None
    v: float | None
    in_time: float | None
    in_space: float | None
    vectors_per_independent: float


def particle_vectors(particles: Particles, scales: Scales) -> tuple[Float64, ...]:
    """t, x, y, u, v of scattered vectors, dimensionless, [N] each."""
    points = scales.points_to_dimensionless(particles.x, particles.y, particles.t)
    velocity = [a.astype(np.float64) for a in (particles.u, particles.v)]
    u, v = (scales.to_dimensionless(a, "velocity") for a in velocity)
    return points[:, 2], points[:, 0], points[:, 1], u, v


def grid_noise(view: View) -> Noise:
    """The noise of vectors on a grid."""
    pair = [np.where(view.there, values, np.nan) for values in (view.u, view.v)]
    in_time = [np.diff(values, _order_in_time(view), axis=0) for values in pair]
    time = [_spread(values, _growth(_order_in_time(view))) for values in in_time]
    factor = _growth(ORDER)
    space = [_spread(np.diff(np.diff(a, ORDER, axis=1), ORDER, axis=2), factor**2) for a in pair]
    chosen = space if view.steady or None in time else time
    return Noise(
        sigma=_rms(chosen),
        u=chosen[0],
        v=chosen[1],
        in_time=_rms(time),
        in_space=_rms(space),
        vectors_per_independent=1.0 if view.steady else _per_independent(in_time),
    )


def _order_in_time(view: View) -> int:
    """Of the differences in time that leave nothing but noise."""
    return 1 if view.steady else ORDER


def _growth(order: int) -> float:
    """Factor on the standard deviation of white noise in differences of an order."""
    return math.sqrt(math.comb(2 * order, order))


def noise_map(view: View) -> Float64:
    """Noise of every cell [Y, X] from its differences in time, NaN where they are few."""
    order = _order_in_time(view)
    squares = np.zeros(view.count.shape[1:])
    enough = np.ones(squares.shape, bool)
    for values in (view.u, view.v):
        size = np.abs(np.diff(np.where(view.there, values, np.nan), order, axis=0))
        enough &= np.isfinite(size).sum(axis=0) >= 5
        middle = np.nanmedian(np.where(enough, size, 0.0), axis=0) if size.size else squares
        squares += (NORMAL * middle / _growth(order)) ** 2
    return np.where(enough, np.sqrt(squares / 2), np.nan)


@dataclass(frozen=True, eq=False)
class ParticleFits:
    """Local parabolas among scattered vectors, dimensionless.

    Attributes:
        noise: the noise of a typical vector.
        where: indices of the sampled vectors [S].
        local: the noise around each of them [S].
        shear_rate: at each of them, less the part of the noise [S].
    """

    noise: Noise
    where: Index
    local: Float64
    shear_rate: Float64


def particle_fits(t: Float64, x: Float64, y: Float64, u: Float64, v: Float64) -> ParticleFits:
    """Noise and shear rate of scattered vectors, dimensionless, all [N]."""
    from scipy.spatial import cKDTree

    chosen, found, rates = [], [], []
    _, size = np.unique(t, return_counts=True)
    order = np.argsort(t, kind="stable")
    starts = np.concatenate([[0], np.cumsum(size)])
    usable = np.flatnonzero(size > NEIGHBORS)
    # Frames spread over the times; within each, vectors spread over their order.
    picked = (
        usable[np.unique(np.linspace(0, usable.size - 1, 40).astype(int))] if usable.size else []
    )
    for k in picked:
        members = order[starts[k] : starts[k + 1]]
        points = np.stack([x[members], y[members]], axis=-1)
        stride = max(1, members.size * len(picked) // SAMPLES)
        centers = np.arange(0, members.size, stride)
        distance, near = cKDTree(points).query(points[centers], k=NEIGHBORS)
        reach = np.maximum(distance[:, -1], np.finfo(float).tiny)
        offset = (points[near] - points[centers][:, None]) / reach[:, None, None]
        variance, rate = _local_parabolas(offset, np.stack([u, v], -1)[members][near], reach)
        found.append(variance)
        rates.append(rate)
        chosen.append(members[centers])
    if not chosen:
        unknown = Noise(None, None, None, None, None, 1.0)
        return ParticleFits(unknown, np.empty(0, np.intp), np.empty(0), np.empty(0))
    variance = np.concatenate(found)
    typical = np.sqrt(np.median(variance, axis=0))
    noise = Noise(
        sigma=float(np.sqrt(np.mean(typical**2))),
        u=float(typical[0]),
        v=float(typical[1]),
        in_time=None,
        in_space=float(np.sqrt(np.mean(typical**2))),
        vectors_per_independent=1.0,
    )
    local = np.sqrt(variance.mean(axis=1))
    return ParticleFits(noise, np.concatenate(chosen), local, np.concatenate(rates))


def particle_noise_map(fits: ParticleFits, x: Float64, y: Float64, view: View) -> Float64:
    """Noise of every cell of a view [Y, X], from scattered vectors at x, y [N]; NaN where none."""
    rows = np.searchsorted((view.y[1:] + view.y[:-1]) / 2, y[fits.where])
    columns = np.searchsorted((view.x[1:] + view.x[:-1]) / 2, x[fits.where])
    shape = view.count.shape[1:]
    place = np.ravel_multi_index((rows, columns), shape)
    n = np.bincount(place, minlength=shape[0] * shape[1])
    sums = np.bincount(place, weights=fits.local**2, minlength=n.size)
    mean = np.sqrt(np.divide(sums, n, out=np.full(n.size, np.nan), where=n > 0))
    return np.asarray(mean.reshape(shape))


def _local_parabolas(offset: Float64, velocity: Float64, reach: Float64) -> tuple[Float64, Float64]:
    """Variance about local parabolas [S, 2], scaled to a median of the noise; shear rate [S].

    Args:
        offset: of the neighbors [S, k, 2], in units of the farthest.
        velocity: of the neighbors [S, k, 2].
        reach: distance of the farthest [S].
    """
    a, b = offset[..., 0], offset[..., 1]
    basis = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=-1)
    left, size, right = np.linalg.svd(basis, full_matrices=False)
    used = size > 1e-8 * size[:, :1]
    left = left * used[:, None, :]
    in_basis = np.swapaxes(left, 1, 2) @ velocity
    fitted = left @ in_basis
    freedom = basis.shape[1] - basis.shape[2]
    median = (1 - CHI2_MEDIAN / freedom) ** 3
    variance: Float64 = np.sum((velocity - fitted) ** 2, axis=1) / (freedom * median)
    inverse = np.swapaxes(right, 1, 2) * np.where(used, 1 / np.where(used, size, 1), 0)[:, None, :]
    slopes = (inverse @ in_basis)[:, 1:3] / reach[:, None, None]  # along x and y, of u and v
    of_noise = np.square(inverse[:, 1:3]).sum(axis=(1, 2)) / reach**2 * variance.sum(axis=1)
    two_D1, two_D2 = slopes[:, 0, 0] - slopes[:, 1, 1], slopes[:, 1, 0] + slopes[:, 0, 1]
    return variance, np.sqrt(np.maximum(two_D1**2 + two_D2**2 - of_noise, 0.0))


def _spread(values: Float64, factor: float) -> float | None:
    finite = values[np.isfinite(values)]
    if finite.size < FEWEST:
        return None
    return float(NORMAL * np.median(np.abs(finite)) / factor)


def _rms(pair: list[float | None]) -> float | None:
    u, v = pair
    return None if u is None or v is None else math.sqrt((u * u + v * v) / 2)


def _per_independent(differences: list[Float64]) -> float:
    """Product over x and y of 1 + 2 (sum of the correlations at 1, 2, ... cells)."""
    product = 1.0
    for axis in (1, 2):
        total = 1.0
        for lag in range(1, FARTHEST + 1):
            n = differences[0].shape[axis]
            if lag >= n:
                break
            correlation = np.mean([_correlation(values, axis, lag) for values in differences])
            if not correlation > LEAST_CORRELATION:
                break
            total += 2 * float(correlation)
        product *= total
    return product


def _correlation(values: Float64, axis: int, lag: int) -> float:
    """Rank-like correlation of neighbors: of the signs, turned into that of normal deviates."""
    n = values.shape[axis]
    a, b = np.take(values, range(n - lag), axis), np.take(values, range(lag, n), axis)
    product = a * b
    product = product[np.isfinite(product) & (product != 0)]
    if product.size < FEWEST:
        return 0.0
    return math.sin(math.pi / 2 * float(np.mean(np.sign(product))))
