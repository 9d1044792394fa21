"""A flow against a simulation of it, at the same times: velocity, front, surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.norms import relative_l2

PROFILE_SHARES = (0.1, 0.3, 0.5, 0.75, 1.0)  # of the last time


class Comparison(NamedTuple):
    """The two flows at the times of the data; lengths in the units of the file.

    Attributes:
        t, front, front_simulated, velocity_percent, profile_rms: [T]; NaN where there is none. A
            layer on a slope has no front.
        x: coordinates of the profiles [X].
        frames: of the profiles [K]; profiles, profiles_simulated: heights of the surface [K, X].
    """

    t: Float64
    front: Float64
    front_simulated: Float64
    velocity_percent: Float64
    profile_rms: Float64
    x: Float64
    frames: list[int]
    profiles: Float64
    profiles_simulated: Float64


class Whole(NamedTuple):
    """Velocity error over the common points, and their share of the points of the data, in %."""

    velocity_percent: float | None
    common_percent: float


class Nodes(NamedTuple):
    """Coordinates of a grid, [Y] and [X]."""

    y: Float64
    x: Float64


def compare(flow: Flow, simulated: Flow) -> tuple[Comparison, Whole]:
    """The data against a simulation with frames at the same times."""
    at = interpolation(simulated, flow)
    known, found, of_frame = [], [], []
    for k in range(len(flow.t)):
        own = np.stack([at(simulated.u[k]), at(simulated.v[k])])
        data = np.stack([flow.u[k], flow.v[k]]).astype(np.float64)
        common = flow.valid[k] & np.isfinite(own).all(axis=0)
        known.append(data[:, common])
        found.append(own[:, common])
        error = relative_l2(own[:, common], data[:, common])
        of_frame.append(math.nan if error is None else error)
    heights, others = surface_heights(flow), surface_heights(simulated)
    others = np.stack([np.interp(flow.x, simulated.x, h, right=0.0) for h in others])
    frames = sorted({int(np.argmin(np.abs(flow.t - s * flow.t[-1]))) for s in PROFILE_SHARES})
    compared = sum(part.shape[1] for part in known)
    whole = Whole(
        relative_l2(np.concatenate(found, 1), np.concatenate(known, 1)),
        100 * compared / max(1, int(flow.valid.sum())),
    )
    comparison = Comparison(
        t=np.asarray(flow.t),
        front=fronts(flow),
        front_simulated=fronts(simulated),
        velocity_percent=np.array(of_frame),
        profile_rms=np.sqrt(np.mean((heights - others) ** 2, axis=1)),
        x=np.asarray(flow.x),
        frames=frames,
        profiles=heights[frames],
        profiles_simulated=others[frames],
    )
    return comparison, whole


def fronts(flow: Flow) -> Float64:
    """Where the fullest cell of a column is half full, by linear interpolation [T]; else NaN."""
    places = []
    for c in flow.c.max(axis=1).astype(np.float64):
        filled = np.flatnonzero(c > 0.5)
        if filled.size == 0:
            places.append(math.nan)
            continue
        i = int(filled.max())
        after, step = (c[i + 1], flow.x[i + 1] - flow.x[i]) if i + 1 < len(c) else (c[i], 0.0)
        places.append(float(flow.x[i] + step * (c[i] - 0.5) / max(c[i] - after, 1e-12)))
    return np.array(places)


def surface_heights(flow: Flow) -> Float64:
    """How thick the grains lie at every x [T, X]."""
    thick: Float64 = flow.c.sum(axis=1, dtype=np.float64) * float(np.median(np.diff(flow.y)))
    return thick


def interpolation(source: Flow | Nodes, target: Flow | Nodes) -> Callable[[Any], Float64]:
    """Bilinear values of a frame of `source` at the grid of `target` [Y, X].

    NaN where one of the four points around is missing or has no value.
    """

    def places(own: Any, wanted: Any) -> tuple[Any, Any, Float64]:
        index = np.interp(wanted, own, np.arange(len(own)), left=np.nan, right=np.nan)
        nearest = np.round(index)
        index = np.where(np.abs(index - nearest) < 1e-6, nearest, index)
        low = np.floor(np.nan_to_num(index)).astype(int)
        part = index - low
        return low, np.where(part > 0, low + 1, low), part

    j, j_up, b = places(source.y, target.y)
    i, i_up, a = places(source.x, target.x)

    def at(frame: Any) -> Float64:
        f = np.asarray(frame, np.float64)
        rows = (1 - a) * f[:, i] + a * f[:, i_up]  # first along x: `source` may have fewer rows
        values: Float64 = (1 - b)[:, None] * rows[j] + b[:, None] * rows[j_up]
        return values

    return at
