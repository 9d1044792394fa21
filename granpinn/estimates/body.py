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
    frames = max(1, MOST_CELLS // weight.size)
    parts = []
    for first in range(0, flow.t.size, frames):
        k = slice(first, first + frames)
        u, v, c = (np.asarray(a[k][:, *some], np.float64) for a in (flow.u, flow.v, flow.c))
        there = (c >= 1) & np.isfinite(u) & np.isfinite(v)
        seen = there.any(axis=(1, 2))
        own = [a[seen] for a in (u, v, c * weight, np.where(there, weight, 0.0))]
        parts.append({"t": flow.t[k][seen]} | _sums(x, y, *own))
    found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return Body(
        sides={name: found.pop(name) for name in INWARD},
        spacing=max(float(np.median(np.diff(axis))) for axis in (x, y)),
        **found,
    )


def _sums(
    x: Float64, y: Float64, u: Float64, v: Float64, grains: Float64, weight: Float64
) -> dict[str, Float64]:
    """The numbers of Body for frames [K], from the area of grains and of vectors [K, Y, X]."""
    area = weight.sum(axis=(1, 2))
    place = np.stack([grains.sum(axis=1) @ x, grains.sum(axis=2) @ y], 1)
    u, v = (np.where(weight > 0, a, 0.0) for a in (u, v))
    mean = np.stack([(a * weight).sum(axis=(1, 2)) / area for a in (u, v)], 1)
    ends = [_ends(axis, weight.sum(axis=k)) for axis, k in ((x, 1), (y, 2))]
    sides = {}
    for name, (d_x, d_y) in INWARD.items():
        axis, (low, high) = (x, ends[0]) if d_x else (y[:, None], ends[1])
        low, high = low[:, None, None], high[:, None, None]
        deep = LAYER * (high - low)
        near: Bool = axis <= low + deep if d_x + d_y > 0 else axis >= high - deep
        here = near & (weight > 0)
        count = here.sum(axis=(1, 2))
        means = [np.where(here, a, 0.0).sum(axis=(1, 2)) / np.maximum(count, 1) for a in (u, v)]
        sides[name] = np.where((count < FEWEST)[:, None], np.nan, np.stack(means, 1))
    return sides | {
        "place": place / grains.sum(axis=(1, 2))[:, None],
        "velocity": mean,
        "energy": (weight * (u**2 + v**2)).sum(axis=(1, 2)) / area / 2,
        "area": area,
        "extent": np.stack([high - low for low, high in ends], 1),
    }


def _ends(axis: Float64, cells: Float64) -> tuple[Float64, Float64]:
    """The places between which all but EDGE of the cells [K, n] at either end lie [K]."""
    share = np.cumsum(cells, axis=1) / cells.sum(axis=1, keepdims=True)
    low, high = ((share < part).sum(axis=1) for part in (EDGE, 1 - EDGE))
    return axis[low], axis[high]
