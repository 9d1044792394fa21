"""The grains as one body: its place, velocity and energy, and its four sides, frame by frame.

Sums over all vectors average their noise: that of the mean of 1,000 vectors is 1/30 of theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.data import Flow

MOST_CELLS = 20_000  # of a frame; rows and columns of larger grids are left out evenly
LAYER = 0.15  # depth of a side, over the extent of the body
EDGE = 0.005  # share of the cells that the extent leaves out on each side: wrong vectors in the air
FEWEST = 10  # vectors in the layer of a side
# Unit vectors into the body, by the name of the side in the axes of the file.
INWARD = {"left side": (1, 0), "right side": (-1, 0), "bottom": (0, 1), "top": (0, -1)}


@dataclass(frozen=True, eq=False)
class Body:
    """Sums over the vectors of every frame that has some [T], in units of the file.

    Attributes:
        t: time.
        place: center of mass of c, (x, y) [T, 2].
        velocity: mean of (u, v) [T, 2].
        energy: mean of (u^2 + v^2)/2.
        area: of the cells with a vector.
        extent: of the body along x and y [T, 2].
        spacing: the larger one of the rows and columns that were summed.
        sides: mean of (u, v) within the layer of each side [T, 2], NaN in a layer of few vectors.
    """

    t: Float64
    place: Float64
    velocity: Float64
    energy: Float64
    area: Float64
    extent: Float64
    spacing: float
    sides: dict[str, Float64]


def body_of(flow: Flow) -> Body:
    """The grains of a flow on a grid, or of the view of scattered vectors on a grid."""
    step = max(1, int(np.ceil(np.sqrt(flow.c[0].size / MOST_CELLS))))
    some = np.s_[:: min(step, flow.y.size // 2), :: min(step, flow.x.size // 2)]
    if int(flow.valid_in(0)[some].sum()) < FEWEST:
        some = np.s_[::1, ::1]
    y, x = flow.y[some[0]], flow.x[some[1]]
    weight = np.gradient(y)[:, None] * np.gradient(x)
    t, frames = [], []
    for time, u, v, c in zip(flow.t, flow.u, flow.v, flow.c, strict=True):
        u, v, c = (np.asarray(a[some], np.float64) for a in (u, v, c))
        there = (c >= 1) & np.isfinite(u) & np.isfinite(v)
        if not there.any():
            continue
        t.append(time)
        frames.append(_frame(x, y, u, v, c * weight, np.where(there, weight, 0.0)))
    place, velocity, energy, area, extent, sides = zip(*frames, strict=True)
    return Body(
        t=np.array(t),
        place=np.array(place),
        velocity=np.array(velocity),
        energy=np.array(energy),
        area=np.array(area),
        extent=np.array(extent),
        spacing=max(float(np.median(np.diff(axis))) for axis in (x, y)),
        sides={name: np.array([side[name] for side in sides]) for name in INWARD},
    )


def _frame(
    x: Float64, y: Float64, u: Float64, v: Float64, grains: Float64, weight: Float64
) -> tuple[Float64, Float64, float, float, Float64, dict[str, Float64]]:
    """The numbers of one frame, in the order of Body, from the area of grains and of vectors."""
    total, area = grains.sum(), weight.sum()
    place = np.array([grains.sum(axis=0) @ x, grains.sum(axis=1) @ y]) / total
    u, v = (np.where(weight > 0, a, 0.0) for a in (u, v))
    mean = np.array([(u * weight).sum(), (v * weight).sum()]) / area
    energy = float((weight * (u**2 + v**2)).sum() / area / 2)
    ends = [_ends(axis, weight.sum(axis=k)) for k, axis in enumerate((x, y))]
    extent = np.array([high - low for low, high in ends])
    sides = {}
    for name, (d_x, d_y) in INWARD.items():
        axis, (low, high) = (x, ends[0]) if d_x else (y[:, None], ends[1])
        deep = LAYER * (high - low)
        near: Bool = axis <= low + deep if d_x + d_y > 0 else axis >= high - deep
        here = near & (weight > 0)
        few = np.full(2, np.nan)
        sides[name] = few if here.sum() < FEWEST else np.array([u[here].mean(), v[here].mean()])
    return place, mean, energy, float(area), extent, sides


def _ends(axis: Float64, cells: Float64) -> tuple[float, float]:
    """The places between which all but EDGE of the cells at either end lie."""
    share = np.cumsum(cells) / cells.sum()
    return float(axis[np.searchsorted(share, EDGE)]), float(axis[np.searchsorted(share, 1 - EDGE)])
