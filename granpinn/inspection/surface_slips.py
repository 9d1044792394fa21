"""Slips of the surface line, and of the direction of gravity where grains run down a slope.

- **Line.** It ends the grains: none are above it, and the first full cell is less than two cells
  below it. Three cells are a margin for a line and vectors of different origin.
- **Downhill.** Grains at a free surface have nothing above that drives them, so on average they
  move down: -y in the axes of gravity. In simulated grains this component is 0.24 to 0.98 of the
  speed there (chutes, drums, heaps, silos, collapses; bench/studies/slips). A plate has no surface.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from granpinn.arrays import Bool
from granpinn.data import Flow, Surface
from granpinn.inspection.upright import Upright, upright
from granpinn.results.slip import IMPOSSIBLE, IMPROBABLE, Slip

CELLS = 3.0  # between the line and the first full cell
LAYER = 4.0  # cells below the line
ABOVE, FAR_ABOVE = 0.1, 0.5  # share of the vectors above the line
UPHILL = -0.1  # mean of (v . g) over mean of |v| |g|
FEWEST = 50  # vectors
FRAMES = 24  # at most


def surface_slips(flow: Flow) -> list[Slip]:
    """Slips of the line first; without one, grains that run uphill."""
    pose = "" if flow.surface is None else upright(_some_frames(flow, flow.surface), 0)
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
    return _uphill(pose, grains & (y > height - LAYER * dy))


def _some_frames(flow: Flow, line: Surface) -> Flow:
    """Frames spread over the flow, with their points of the line."""
    k = np.unique(np.linspace(0, flow.t.size - 1, FRAMES).round().astype(int))
    if k.size == flow.t.size:
        return flow
    frame = np.searchsorted((flow.t[1:] + flow.t[:-1]) / 2, line.t)
    kept = np.isin(frame, k)
    line = Surface(line.t[kept], line.x[kept], line.y[kept])
    return replace(flow, t=flow.t[k], u=flow.u[k], v=flow.v[k], c=flow.c[k], p=None, surface=line)


def _uphill(pose: Upright, layer: Bool) -> list[Slip]:
    """Grains of the uppermost layer [T, Y, X] that move against gravity."""
    u, v = (np.asarray(a[layer], np.float64) for a in (pose.u, pose.v))
    g_x, g_y = pose.gravity
    speed = float(np.hypot(u, v).sum()) * math.hypot(g_x, g_y)
    if u.size < FEWEST or not speed > 0:
        return []
    down = float((g_x * u + g_y * v).sum()) / speed
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
