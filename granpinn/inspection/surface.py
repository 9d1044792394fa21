"""The free surface: its line ends the grains, and they run downhill below it.

- **Line.** It ends the grains: none are above it, and the first full cell is less than two cells
  below it. Three cells are a margin for a line and vectors of different origin.
- **Downhill.** Grains at a free surface have nothing above that drives them, so on average they
  move down: -y in the axes of gravity. In simulated grains this component is 0.24 to 0.98 of the
  speed there (chutes, drums, heaps, silos, collapses; bench/studies/slips). A plate has no surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.data import Flow
from granpinn.data.large import some_frames
from granpinn.estimates.stress import upright
from granpinn.inspection import Inspection
from granpinn.results.record import ADVICE, IMPOSSIBLE, IMPROBABLE, Check, Reason, Record

CELLS = 3.0  # between the line and the first full cell
LAYER = 4.0  # cells below the line
ABOVE, FAR_ABOVE = 0.1, 0.5  # share of the vectors above the line
UPHILL = -0.1  # mean of (v . g) over mean of |v| |g|
FEWEST = 50  # vectors
DENSE = 0.8  # of the cells of a column have vectors: fewer leave a gap below any line
FRAMES = 24  # at most


@dataclass(frozen=True)
class FreeSurface(Record):
    """The line of the free surface against the vectors.

    They are not compared with few vectors below the line, with other forces than gravity, or
    without a grid.

    Attributes:
        points: of the line.
        frames: share of the frames with points.
        above: share of the vectors more than CELLS above the line.
        gap: height of the line over the uppermost full cells, median over the columns without
            holes, in cells; 0 if most columns have holes.
        down: mean of v . g over mean of |v| |g|, in the uppermost LAYER cells; None: not known.
    """

    title = "free surface"

    points: int
    frames: float
    above: float = 0.0
    gap: float = 0.0
    down: float | None = None

    @property
    def words(self) -> str:
        return f"{self.points} points in {self.frames:.0%} of the frames" if self.points else "none"

    def reasons(self, of: Inspection) -> list[Reason]:
        if not self.points:
            if of.undetermined is not None:
                return []
            text = "No free surface: level V0 only; give the line, it fixes the pressure."
            return [Reason(ADVICE, text)]
        if self.above > ABOVE:
            text = (
                f"{self.above:.0%} of the vectors lie more than {CELLS:g} cells above the line of "
                "the free surface, measured against gravity: check the unit, the origin and the "
                "sign of surface_y, and the direction of gravity"
            )
            return [Reason(IMPOSSIBLE if self.above > FAR_ABOVE else IMPROBABLE, text)]
        if abs(self.gap) > CELLS:
            side = "above" if self.gap > 0 else "below"
            text = (
                f"the line of the free surface lies {abs(self.gap):.2g} cells {side} the uppermost "
                "vectors: check its origin and unit, and its direction of y"
            )
            return [Reason(IMPROBABLE, text)]
        if self.down is None or self.down > UPHILL:
            return []
        text = (
            f"the grains at the free surface run uphill ({-self.down:.2f} of their speed is "
            "against gravity): check the signs of u, v, x and y, the direction of gravity, and "
            "the order of the frames"
        )
        return [Reason(IMPROBABLE, text)]


def make(inspection: Inspection) -> FreeSurface:
    flow = inspection.filmed
    if flow.surface is None:
        return FreeSurface(0, 0.0)
    middle = (flow.t[1:] + flow.t[:-1]) / 2
    frames = np.unique(np.searchsorted(middle, flow.surface.t)).size
    found = FreeSurface(flow.surface.t.size, frames / flow.t.size)
    some = np.unique(np.linspace(0, flow.t.size - 1, FRAMES).round().astype(int))
    pose = upright(some_frames(flow, some), 0) if flow.source is None else "driven"
    if isinstance(pose, str):
        return found
    flow = pose.flow
    dy = float(np.diff(flow.y).mean())
    height, y = pose.height[:, None, :], flow.y[:, None]
    grains = (flow.c > 0.5) & np.isfinite(flow.u) & np.isfinite(flow.v) & np.isfinite(height)
    if grains.sum() < FEWEST:
        return found
    top, whole = _tops(grains, flow.y)
    dense = 2 * whole.sum() > np.isfinite(top).sum()
    return replace(
        found,
        above=float(np.mean((y > height + CELLS * dy)[grains])),
        gap=float(np.median((pose.height - top)[whole])) / dy if dense else 0.0,
        down=_downhill(flow, grains & (y > height - LAYER * dy)),
    )


def _tops(grains: Bool, y: Float64) -> tuple[Float64, Bool]:
    """Height of the uppermost vectors [T, X], and which columns have no holes."""
    at = y[:, None]
    top = np.where(grains, at, -np.inf).max(axis=1)
    lowest = np.where(grains.any(axis=0), at, np.inf).min(axis=0)
    there = np.isfinite(top)
    cells = np.where(there, top - lowest, 0) / float(np.diff(y).mean()) + 1
    return top, there & (grains.sum(axis=1) >= DENSE * cells)


def _downhill(flow: Flow, layer: Bool) -> float | None:
    """The mean of v . g over that of |v| |g| in a layer [T, Y, X]."""
    u, v = (np.asarray(a[layer], np.float64) for a in (flow.u, flow.v))
    g_x, g_y = flow.gravity
    speed = float(np.hypot(u, v).sum()) * math.hypot(g_x, g_y)
    if u.size < FEWEST or not speed > 0:
        return None
    return float((g_x * u + g_y * v).sum()) / speed


CHECK = Check("surface", FreeSurface, make, seconds=0.08, explains=True)
