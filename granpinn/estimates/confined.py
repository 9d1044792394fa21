r"""What the velocity leaves open: in flows without a free surface, and between walls.

Velocity and acceleration give differences of the stress, never its level. Under a free surface the
level is known, because there is no stress on it. Without one, two things can be missing:

- **the pressure**, if it is known on no wall (`wall_p`): mu is a stress over the pressure;
- **the shear stress**, if walls alone drive the flow. With mu, take k mu and k tau: the law is
  satisfied as before, and the momentum balance changes by (k - 1) div tau. This is nothing where
  the shear stress is uniform, as in plane shear. In general the virtual work of tau in the motion
  of the grains themselves is that of gravity and inertia on them, and of the walls:

  $$ \int \tau : D \, dA = \int \rho (g - a) \cdot v \, dA + \text{work of the walls}. $$

  In a steady flow between walls the first part on the right is zero, for as much rises as falls.
  What walls do is not in the velocity. So mu follows up to a factor: mu_2/mu_s, for example.

**Grains that hang between walls** are another case: the base does not carry them. Between walls a
distance W apart, on which the grains slide with the friction mu, the pressure a depth z below the
surface is less than the weight above (Janssen). With equal normal stresses in all directions the
walls carry the share

$$ 1 - \frac{1 - e^{-k}}{k}, \quad k = 2 \mu z / W . $$

How much friction there is on the walls is not in the velocity; nor is the stress of grains that
move as a block between them. So the share counts with a usual friction, and tells only whether the
walls matter.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Level
from granpinn.data import Flow, with_partial_cells
from granpinn.data.outline import outline
from granpinn.data.walls import Segments, segments_of
from granpinn.estimates.stress import Upright

# Part of the work that gravity would do if all grains fell, below which it does not drive a flow.
NO_WORK = 0.02

NO_PRESSURE = (
    "the flow has no free surface, and no wall with a known pressure (wall_p), so that nothing "
    "fixes the pressure: only its differences are known"
)
NO_WORK_WORDS = (
    "the flow has no free surface, and gravity does no work in it, so that walls alone drive it: "
    "the shear stress is that of the walls, which the velocity does not show; only ratios of mu "
    "at different I follow"
)


def undetermined(flow: Flow, level: Level) -> str | None:
    """Why the velocity of a flow gives no friction coefficient; None if it gives one.

    Args:
        level: decides whether the free surface is the line of the file or the upper edge of the
            grains.
    """
    free = outline(with_partial_cells(flow)) if level == "V0" else flow.surface
    if free is not None and free.t.size:
        return None
    walls = flow.walls
    if flow.steady and _work(flow) < NO_WORK:
        return NO_WORK_WORDS
    if walls is None or walls.p is None or not np.isfinite(walls.p).any():
        return NO_PRESSURE
    return None


def _work(flow: Flow) -> float:
    """|sum of g . v| over the sum of |g||v|, of all vectors; 0 if nothing moves."""
    if flow.particles is not None:
        u, v = flow.particles.u.astype(np.float64), flow.particles.v.astype(np.float64)
    else:
        u, v = (a[flow.valid].astype(np.float64) for a in (flow.u, flow.v))
    g_x, g_y = flow.gravity
    total = float(np.hypot(g_x, g_y) * np.hypot(u, v).sum())
    return abs(float((g_x * u + g_y * v).sum())) / total if total > 0 else 0.0


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
    share, pair = _shares(pose, frame, walls)
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
