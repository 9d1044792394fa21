r"""In which directions a flow does not change: steady flows, and flows that are the same along x.

A network that may depend on such a direction finds forces that are not there. In a chute it finds a
pressure gradient along the slope, which takes a part of the weight; mu(I) is then wrong by more
than 10 %. With the noise of the frames as acceleration, mu(I) of a filmed drum was 12 % wrong. So
the network gets neither the time of a steady flow nor the x of a uniform one.

**Steady.** The file says so (`steady`), it has one frame, or the data decide. A steady flow on a
grid becomes one frame, its mean over time. With the mean velocity
$m$, the speed of the flow as a whole in a frame is $\sum u \cdot m / \sum m \cdot m$; the noise of
its vectors cancels. The record has `PARTS` equal parts. The flow is steady if

- **its speed has no trend.** A constant rate, a start and an end that decay over a part of the
  record explain no more of the means over the parts than noise does, in an F test (`TREND`).
  Neither the size of the noise nor its correlation must be known: steady flows fail
  in 1 % with white noise, and in 4 % with noise that is correlated over 1/20 of the record;
- **what the test misses does no harm.** The means over the parts, the first and the last frame
  differ by less than an acceleration of `HARMFUL` times gravity gives over the record; mu is wrong
  by about as much. So a short or a very noisy record is not steady;
- **its speed fluctuates little**, by less than `FLUCTUATION` in standard deviation. Then the means
  of products are nearly the products of means;
- **its surface stays** within a grain or a spacing of the grid, in rms over the parts.

The standard error of the mean is that of the means over the parts, in rms over the cells: in each
cell it is too uncertain for a weight.

**The same along x.** The file states `period_x` or has a free surface, and the data do not
contradict. They do if the velocity varies along x by more than `LARGEST_VARIATION` of its rms,
beyond its noise; or if the free surface is uneven by more than a grain, or by more than the
spacing of the grid. With p = 0 on an even surface, the weight of the grains makes the pressure
the same along x too.

The variation along x is that of means over time, in four parts of the record, so that the random
motion of grains cancels. It is the power of all waves longer than four columns, in excess of what
the shorter waves have; white noise has equal power in both. The excess counts from three standard
deviations of this difference on.

In a flow that is the same along x, grains that keep their volume have v_y = -u_x = 0, and none pass
the base: v = 0 (`v_factor` of granpinn/physics/constants.py). A small v that noise allows carries
momentum across the shear. It made mu(I) of steep chutes too flat, by up to 18 %.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from granpinn.arrays import Float64, Floats, Index
from granpinn.data.flow import STEADY, Flow, Surface
from granpinn.data.large import SLAB_CELLS, thinned
from granpinn.data.surface import folded, line_heights
from granpinn.physics.axes import Axes

PARTS = 10
TREND = 9.78  # F with 3 and 6 degrees of freedom; 1 % of white noise is above it
HARMFUL = 0.003  # of gravity
FLUCTUATION = 0.3  # of the mean speed
FLOAT32 = 2.0**-23  # rounding of velocities, below which nothing is a trend
# Of the vectors, or of the points of the line, that others have; of the columns of a row.
LEAST_FILLED = 0.5
WEIGHT, U, V, C, FULL = range(5)  # sums over frames
LARGEST_VARIATION = 0.03  # along x, of the rms velocity
QUARTERS = 4  # parts of the record
SURE = 3.0  # standard deviations
FEWEST_COLUMNS = 8  # fewer ones have too few waves to tell noise

UNIFORM, UNCHANGING = "the same along x: no derivative along x", "steady: no time derivative"
WORDS = {0: UNIFORM, 2: UNCHANGING}


def invariant_axes(flow: Flow) -> tuple[bool, bool, bool]:
    """Whether the flow does not change with x, y and t, in the axes of its training."""
    return same_along_x(flow), False, flow.steady


def words(invariant: tuple[bool, ...]) -> tuple[str, ...]:
    """What `invariant_axes` found, in words; none for a flow that depends on everything."""
    return tuple(WORDS[axis] for axis in WORDS if invariant[axis])


def with_layer(flow: Flow) -> Flow:
    """The flow, marked as a `layer` if only its data show that it is the same along x."""
    if flow.periodic or flow.surface is None or flow.particles is not None:
        return flow
    layer = replace(flow, layer=True)
    return layer if same_along_x(thinned(layer)) else flow


def axes_of(flow: Flow) -> Axes:
    """The axes in which a flow is trained; those of the file if it is periodic along x."""
    if not flow.periodic:
        return Axes.of(flow.gravity)
    g = math.hypot(*flow.gravity)
    return Axes(1.0, 0.0, (flow.gravity[0] / g, flow.gravity[1] / g))


def same_along_x(flow: Flow) -> bool:
    """Whether a periodic flow is the same along x, as its data say (see the top)."""
    if not flow.periodic or _is_uneven(flow):
        return False
    frames = np.array_split(np.arange(flow.t.size), min(QUARTERS, flow.t.size))
    parts = [part for k in frames if (part := _rows(flow, k)).size]
    if not parts:
        return False
    rows = np.concatenate(parts)
    size = float(np.mean(np.square(rows)))
    return bool(_variation(rows) <= LARGEST_VARIATION**2 * size)


def _rows(flow: Flow, frames: Index) -> Float64:
    """Means over some frames of u and v, for every row [2 R, X] that is filled well enough."""
    valid = flow.valid_in(frames)
    count = valid.sum(axis=0)
    means = [
        np.where(valid, a[frames], 0.0).sum(axis=0, dtype=np.float64) / np.maximum(count, 1)
        for a in (flow.u, flow.v)
    ]
    there = count > 0
    filled = there.mean(axis=1) >= LEAST_FILLED
    there = there[filled]
    found = []
    for values in (mean[filled] for mean in means):
        middle = np.sum(values, axis=1, where=there) / np.maximum(there.sum(axis=1), 1)
        found.append(np.where(there, values, middle[:, None]))
    return np.concatenate(found)


def _variation(rows: Float64) -> float:
    """Mean square of the variation along rows [K, X] in long waves, beyond noise."""
    X = rows.shape[1]
    wave = np.fft.rfft(rows - rows.mean(axis=1, keepdims=True), axis=1)[:, 1:]
    power: Float64 = 2 * np.mean(np.square(np.abs(wave)), axis=0) / X**2  # of every wave
    if X % 2 == 0:
        power[-1] /= 2
    if X < FEWEST_COLUMNS:
        return float(power.sum())
    long = X // 4
    short = (X - 1) / 2 - long
    noise = float(power[long:].sum()) * long / short
    error = SURE * noise * math.sqrt((1 / long + 1 / short) / rows.shape[0])
    return max(float(power[:long].sum() - noise - error), 0.0)


def _is_uneven(flow: Flow) -> bool:
    """Whether the free surface varies along x, in rms over all times; False without a surface."""
    surface = flow.surface
    if surface is None:
        return False
    _, time = np.unique(surface.t, return_inverse=True)
    n = np.bincount(time)
    mean = np.bincount(time, weights=surface.y) / n
    uneven = float(np.sqrt(np.mean(np.square(surface.y - mean[time]))))
    return uneven > max(flow.grain_diameter, flow.spacing[1])


def steady_mean(flow: Flow) -> Flow:
    """A steady flow on a grid as its mean over time, a flow of one frame; any other flow as it is.

    Scattered vectors stay as they are: their times do not matter if the file says `steady`.
    """
    stated = flow.attributes.get(STEADY)
    if flow.particles is not None or flow.source is not None or stated == 0:
        return flow
    if flow.t.size > 1 and stated is None and not is_steady(thinned(flow)):
        return flow
    T, surface, p = flow.t.size, flow.surface, thinned(flow).p
    t = np.array([flow.t.mean()])
    line = None if surface is None else _line(flow, surface, float(t[0]))
    if T == 1:
        return replace(flow, surface=line)
    sums = _sums(flow, min(PARTS, T))
    weight, u, v, c, full = sums.sum(axis=0)
    share = weight / np.maximum(c, 1e-9)  # of the frames with grains
    weight[share <= LEAST_FILLED * np.median(share[weight > 0])] = np.nan
    sigma_u, sigma_v = _standard_errors(sums, T)
    mean = replace(
        flow,
        t=t,
        u=(u / weight)[None].astype(flow.u.dtype),
        v=(v / weight)[None].astype(flow.v.dtype),
        c=np.where(full >= T / 2, 1.0, c / T)[None].astype(np.float32),
        p=None if p is None else _mean(p)[None].astype(np.float32),
        surface=line,
        sigma_u=sigma_u,
        sigma_v=sigma_v,
        averaged=T,
    )
    return with_layer(mean)


def said(flow: Flow) -> str | None:
    """Which frames are used, in words: those of a large flow, or the mean over time, and why."""
    if flow.every > 1:
        return f"large flow: {flow.t.size} frames are used, one of every {flow.every}"
    if flow.averaged == 1:
        return None
    known = flow.attributes.get(STEADY) == 1
    why = "the file says so" if known else "its changes are within noise and sampling error"
    return f"the flow is steady ({why}): the mean over its {flow.averaged} frames is used"


def is_steady(flow: Flow) -> bool:
    """Whether the frames of a flow show one flow, as far as its data can tell (see the top)."""
    if flow.t.size < PARTS or not _surface_stays(flow):
        return False
    speed, rms = _speeds(flow)
    parts = np.array_split(speed, PARTS)
    means, weight = (np.array([f(part) for part in parts]) for f in (np.mean, np.size))
    change = float(np.ptp([*means, speed[0], speed[-1]])) * rms
    harmful = HARMFUL * math.hypot(*flow.gravity) * float(flow.t[-1] - flow.t[0])
    return bool(
        change < harmful and speed.std() < FLUCTUATION and not _has_trend(means, np.sqrt(weight))
    )


def _has_trend(means: Float64, weight: Float64) -> bool:
    """Whether means over parts of the record [PARTS] have one, with their weights 1/sd."""
    k = np.arange(PARTS)
    shapes = np.stack([np.ones(PARTS), k, np.exp(-k), np.exp(k - PARTS + 1)], axis=1)
    axes, _ = np.linalg.qr(weight[:, None] * shapes)
    amplitudes = axes.T @ (weight * means)
    rest = weight * means - axes @ amplitudes
    free = PARTS - len(amplitudes)
    noise = max(float(np.sum(rest**2)) / free, FLOAT32**2)
    return bool(np.mean(amplitudes[1:] ** 2) > TREND * noise)


def _speeds(flow: Flow) -> tuple[Float64, float]:
    """Speed of the flow as a whole in every frame [T], over that of its mean; and rms of the mean
    velocity. NaN for grains at rest."""
    valid = flow.valid
    count = valid.sum(axis=0)
    valid &= count >= LEAST_FILLED * count.max()
    u, v = (np.where(valid, a, 0.0) for a in (flow.u, flow.v))
    mean = [a.sum(axis=0, dtype=np.float64) / np.maximum(count, 1) for a in (u, v)]
    square = mean[0] ** 2 + mean[1] ** 2
    size = np.einsum("tyx,yx->t", valid, square)
    along = sum(np.einsum("tyx,yx->t", a, m) for a, m in zip((u, v), mean, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        return along / size, math.sqrt(float(size.sum() / valid.sum()))


def _sums(flow: Flow, count: int) -> Float64:
    """Sums over the frames of each part, in every cell [P, 5, Y, X]."""
    found = np.zeros((count, 5, *flow.c.shape[1:]))
    step = max(1, SLAB_CELLS // flow.c[0].size)
    for k, part in enumerate(np.array_split(np.arange(flow.t.size), count)):
        for first in range(part[0], part[-1] + 1, step):
            frames = slice(first, min(first + step, part[-1] + 1))
            c, u, v = (a[frames].astype(np.float64) for a in (flow.c, flow.u, flow.v))
            there = np.isfinite(u) & np.isfinite(v) & (c > 0)
            weight = np.where(there, c, 0.0)
            rows = [weight, *(weight * np.where(there, a, 0.0) for a in (u, v)), c, c >= 1]
            found[k] += [values.sum(axis=0) for values in rows]
    return found


def _standard_errors(sums: Float64, frames: int) -> tuple[float, float] | tuple[None, None]:
    """Of the means of u and v, in rms over the cells with enough vectors in every part; None if
    the parts do not differ."""
    weight = sums[:, WEIGHT]
    fullest = weight.max(axis=(1, 2), keepdims=True)
    there = ((weight > 0) & (weight >= LEAST_FILLED * fullest)).all(axis=0)
    if not there.any():
        return None, None
    means = sums[:, [U, V]][..., there] / weight[:, None, there]
    n = np.array([k.size for k in np.array_split(np.arange(frames), len(sums))])[:, None, None]
    square = np.sum(n * (means - np.sum(n * means, axis=0) / frames) ** 2, axis=0).mean(axis=1)
    u, v = map(float, np.sqrt(square / (len(sums) - 1) / frames))
    return (u, v) if u > 0 and v > 0 else (None, None)


def _surface_stays(flow: Flow) -> bool:
    """Whether the free surface, or without a line the thickness of the grains, stays in place."""
    step, line = flow.spacing[1], flow.surface
    if line is None:
        height = flow.c.sum(axis=1, dtype=np.float64) * step
    else:
        height = line_heights(flow.t, flow.x, line)
    middle = np.stack([_mean(part) for part in np.array_split(height, PARTS)])
    moved = (middle - middle.mean(axis=0))[:, np.isfinite(middle).all(axis=0)]
    limit = max(flow.grain_diameter, step)
    return moved.size > 0 and math.sqrt(float(np.mean(np.square(moved)))) <= limit


def _line(flow: Flow, surface: Surface, time: float) -> Surface:
    """The mean over the frames of a line with one height in every column; else all its points."""
    x = flow.x
    folds = folded(flow.t, x, surface).mean(axis=0)
    if flow.t.size == 1 or (folds > LEAST_FILLED).any():
        return replace(surface, t=np.full(surface.t.shape, time))
    height = line_heights(flow.t, x, surface)
    kept = np.isfinite(height).mean(axis=0) >= LEAST_FILLED * np.isfinite(height).any(axis=1).mean()
    p = surface.p
    if p is not None:
        p = _mean(line_heights(flow.t, x, replace(surface, y=p.astype(np.float64))))[kept]
        p = p.astype(np.float32)
    return Surface(np.full(int(kept.sum()), time), x[kept], _mean(height)[kept], p)


def _mean(values: Floats) -> Float64:
    """Over the first axis, without NaN; NaN where nothing else is."""
    mean: Float64 = np.ma.masked_invalid(values).mean(axis=0, dtype=np.float64).filled(np.nan)
    return mean
