r"""Grains that hang between walls: what the base does not carry.

Between walls a distance W apart, on which the grains slide with the friction mu, the pressure a
depth z below the surface is less than the weight above (Janssen). With equal normal stresses in all
directions the walls carry the share

$$ 1 - \frac{1 - e^{-k}}{k}, \quad k = 2 \mu z / W . $$

How much friction there is on the walls is not in the velocity; nor is the stress of grains that
move as a block between them. So the share counts with a usual friction, and tells only whether the
walls matter.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.walls import Segments, segments_of
from granpinn.estimates.upright import Upright

FRICTION = 0.4
LARGEST_SHARE = 1 / 3  # of the weight; half of that is carried at a depth of half the width
DEEP = 95.0  # percentile of the share among the grains


def hanging(flow: Flow, pose: Upright) -> str | None:
    """Between which walls the grains hang, in words; None if they stand on their base.

    Args:
        pose: the same flow below its surface line.
    """
    if flow.walls is None:
        return None
    walls = segments_of(flow.walls)
    names = walls.names()
    frame = int(np.argmax(np.isfinite(pose.height).sum(axis=1)))
    ((_, there),) = walls.spells(flow.t[frame : frame + 1])
    share, pair = _shares(pose, frame, there)
    if share.size == 0 or np.percentile(share, DEEP) <= LARGEST_SHARE:
        return None
    left, right = (names[wall] for wall in pair[int(np.argmax(share))])
    return (
        f"the grains hang between {left} and {right}: walls so near carry about "
        f"{np.percentile(share, DEEP):.0%} of the weight of the lowest grains, and how much they "
        "really carry is not in the velocity"
    )


def _shares(pose: Upright, frame: int, walls: Segments) -> tuple[Float64, np.ndarray]:
    """The share of the weight above every cell of grains between two walls [n], and their numbers
    [n, 2]."""
    flow = pose.flow
    below = pose.height[frame][None] - flow.y[:, None]
    grains = (flow.c[frame] > 0.5) & (below > 0)
    shares, pairs = [], []
    for row, y in enumerate(flow.y):
        x, wall = _crossings(walls, float(y))
        k = np.searchsorted(x, flow.x)
        between = grains[row] & (k > 0) & (k < len(x))
        right = k[between]
        depth = below[row][between]
        ratio = 2 * FRICTION * depth / (x[right] - x[right - 1])
        shares.append(1 + np.expm1(-ratio) / ratio)
        pairs.append(np.stack([wall[right - 1], wall[right]], 1))
    return np.concatenate(shares), np.concatenate(pairs)


def _crossings(walls: Segments, y: float) -> tuple[Float64, np.ndarray]:
    """Where walls cross a height, in the order of x, and the numbers of the walls."""
    a, b = walls.ends[:, 0], walls.ends[:, 1]
    there = (a[:, 1] <= y) != (b[:, 1] <= y)
    a, b = a[there], b[there]
    x = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    order = np.argsort(x)
    return x[order], walls.wall[there][order]
