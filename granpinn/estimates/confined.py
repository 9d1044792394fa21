r"""What the velocity leaves open in a flow without a free surface.

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
"""

from __future__ import annotations

import numpy as np

from granpinn.config import Level
from granpinn.data import Flow, with_partial_cells
from granpinn.data.outline import outline

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
