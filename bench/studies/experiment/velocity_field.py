"""A simulated flow as a continuous field: what an imaginary camera films, and the truth of its PIV.

Velocity and volume fraction are bilinear in space and linear in time between the cells and frames
of the flow. The flow knows velocities inside the grains only; a few cells beyond the free surface
they go on as the mean of their neighbors, so that a grain at the surface has a velocity, too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from granpinn.data import Flow

Array = npt.NDArray[np.float64]

LAYERS = 4  # of cells beyond the surface that get a velocity


class VelocityField:
    """Samples a flow on an even grid at any (t, x, y), in the units of the flow."""

    def __init__(self, flow: Flow) -> None:
        if flow.particles is not None or flow.surface is None:
            raise ValueError("the flow must be on a grid and know its surface, got another one")
        self.t, self.y, self.x = flow.t, flow.y, flow.x
        self.c = flow.c.astype(np.float64)
        self.u, self.v = (beyond(a.astype(np.float64), LAYERS) for a in (flow.u, flow.v))

    def velocity(self, t: float, x: Array, y: Array) -> Array:
        """(u, v) [2, n] at a time and at points [n]; 0 farther than LAYERS cells from grains."""
        return np.stack([self._sample(field, t, x, y) for field in (self.u, self.v)])

    def advect(self, points: Array, t: float, span: float) -> Array:
        """Where grains at `points` [2, n] at time t are after `span` (before, if negative).

        The midpoint rule: for some pixels of motion its error is far below that of the PIV.
        """
        half = points + 0.5 * span * self.velocity(t, *points)
        return np.asarray(points + span * self.velocity(t + 0.5 * span, *half))

    def fraction(self, t: float, x: Array, y: Array) -> Array:
        """Volume fraction of grains [n]."""
        return self._sample(self.c, t, x, y)

    def _sample(self, field: Array, t: float, x: Array, y: Array) -> Array:
        """Beyond the outermost cell centers those count."""
        k = int(np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, self.t.size - 2))
        share = float(np.clip((t - self.t[k]) / (self.t[k + 1] - self.t[k]), 0, 1))
        frame = (1 - share) * field[k] + share * field[k + 1]
        cells = [(v - axis[0]) / (axis[1] - axis[0]) for v, axis in ((y, self.y), (x, self.x))]
        return np.asarray(ndimage.map_coordinates(frame, cells, order=1, mode="nearest"))


def beyond(field: Array, layers: int) -> Array:
    """A field [T, Y, X] whose NaN next to numbers become the mean of those, layer by layer; 0."""
    out, around = field.copy(), np.ones((1, 3, 3))
    for _ in range(layers):
        known = np.isfinite(out)
        values = np.where(known, out, 0.0), known.astype(np.float64)
        total, count = (ndimage.convolve(a, around, mode="constant") for a in values)
        new = ~known & (count > 0)
        out[new] = total[new] / count[new]
    return np.nan_to_num(out)
