"""Slips of the surface line, and of the direction of gravity where grains run down a slope.

- **Line.** It ends the grains: none are above it, and the first full cell is less than two cells
  below it. Three cells are a margin for a line and vectors of different origin.
- **Downhill.** Grains at a free surface have nothing above that drives them, so on average they
  move down: -y in the axes of gravity. In simulated grains this component is 0.24 to 0.98 of the
  speed there (chutes, drums, heaps, silos, collapses; bench/studies/slips). A plate has no surface.
"""

from __future__ import annotations

import math

import numpy as np

from granpinn.data import Flow
from granpinn.inspection.upright import upright
from granpinn.results.slip import IMPOSSIBLE, IMPROBABLE, Slip

CELLS = 3.0  # between the line and the first full cell
LAYER = 4.0  # cells below the line
ABOVE, FAR_ABOVE = 0.1, 0.5  # share of the vectors above the line
UPHILL = -0.1  # mean of (v . g) over mean of |v| |g|
FEWEST = 50  # vectors


def surface_slips(flow: Flow) -> list[Slip]:
    """Slips of the line first; without one, grains that run uphill."""
    pose = upright(flow, 0) if flow.surface is not None else ""
    if isinstance(pose, str):
        return []
    dy = float(np.diff(pose.y).mean())
    height, y = pose.height[:, None, :], pose.y[:, None]
    grains = (pose.c > 0.5) & np.isfinite(pose.u) & np.isfinite(pose.v) & np.isfinite(height)
    if grains.sum() < FEWEST:
        return []
    above = float(np.mean((y > height + CELLS * dy)[grains]))
    top = np.where(grains, y, -np.inf).max(axis=1)
    gap = float(np.median((pose.height - top)[np.isfinite(top)]) / dy)
    if above > ABOVE:
        return [
            Slip(
                IMPOSSIBLE if above > FAR_ABOVE else IMPROBABLE,
                f"{above:.0%} of the vectors lie more than {CELLS:g} cells above the line of the "
                "free surface, measured against gravity: check the unit, the origin and the sign "
                "of surface_y, and the direction of gravity",
            )
        ]
    if abs(gap) > CELLS:
        side = "above" if gap > 0 else "below"
        return [
            Slip(
                IMPROBABLE,
                f"the line of the free surface lies {abs(gap):.2g} cells {side} the uppermost "
                "vectors: check its origin and unit, and its direction of y",
            )
        ]
    return _uphill(pose.u, pose.v, grains & (y > height - LAYER * dy), pose.gravity)


def _uphill(u, v, layer, gravity) -> list[Slip]:  # type: ignore[no-untyped-def]
    u, v = (np.asarray(a[layer], np.float64) for a in (u, v))
    speed = float(np.hypot(u, v).sum()) * math.hypot(*gravity)
    if u.size < FEWEST or not speed > 0:
        return []
    down = float((gravity[0] * u + gravity[1] * v).sum()) / speed
    if down > UPHILL:
        return []
    return [
        Slip(
            IMPROBABLE,
            f"the grains at the free surface run uphill ({-down:.2f} of their speed is against "
            "gravity): check the signs of u, v, x and y, the direction of gravity, and the order "
            "of the frames",
        )
    ]
