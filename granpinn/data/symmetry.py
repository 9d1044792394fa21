r"""In which directions a flow does not change: steady flows, and flows that are the same along x.

A network that may depend on such a direction finds forces that are not there. In a chute it finds a
pressure gradient along the slope, which takes a part of the weight; mu(I) is then wrong by more
than 10 %. So the network gets neither the time of a steady flow nor the x of a uniform one.

In a flow that is the same along x, grains that keep their volume have v_y = -u_x = 0, and none pass
the base: v = 0 (`v_factor` of granpinn/physics/constants.py). A small v that noise allows carries
momentum across the shear. It made mu(I) of steep chutes too flat, by up to 18 %.

- **Steady**: the file says so (`steady`), or it has one frame.
- **The same along x**: the file states `period_x` or has a free surface, and the data do not
  contradict. They do if the velocity varies along x by more than `LARGEST_VARIATION` of its rms,
  beyond its noise; or if the free surface is uneven by more than a grain, or by more than the
  spacing of the grid. With p = 0 on an even surface, the weight of the grains makes the pressure
  the same along x too.

The variation along x is that of means over time, in four parts of the record, so that the random
motion of grains cancels. It is the power of all waves longer than four columns, in excess of what
the shorter waves have; white noise has equal power in both. The excess counts from three standard
deviations of this difference on.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from granpinn.arrays import Float64, Index
from granpinn.data.flow import Flow
from granpinn.data.large import thinned
from granpinn.physics.axes import Axes

LARGEST_VARIATION = 0.03  # of the rms velocity
PARTS = 4  # of the record
SURE = 3.0  # standard deviations
FEWEST_COLUMNS = 8  # fewer ones have too few waves to tell noise
LEAST_FILLED = 0.5  # of the columns of a row; gaps get the mean of the row

UNIFORM, STEADY = "the same along x: no derivative along x", "steady: no time derivative"
WORDS = {0: UNIFORM, 2: STEADY}


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
    frames = np.array_split(np.arange(flow.t.size), min(PARTS, flow.t.size))
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
