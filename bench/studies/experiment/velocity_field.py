"""A simulated flow as a continuous field: what an imaginary camera films, and the truth of its PIV.

Velocity and volume fraction are bilinear in space and linear in time between the cells and frames
of the flow. The flow knows velocities inside the grains only; a few cells beyond the free surface
they go on as the mean of their neighbors, so that a grain at the surface has a velocity, too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

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

    def fraction(self, t: float, x: Array, y: Array) -> Array:
        """Volume fraction of grains [n]."""
        return self._sample(self.c, t, x, y)

    def _place(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Positions in cells; beyond the outermost cell centers those count."""
        column = (x - self.x[0]) / (self.x[1] - self.x[0])
        row = (y - self.y[0]) / (self.y[1] - self.y[0])
        return np.clip(column, 0, self.x.size - 1), np.clip(row, 0, self.y.size - 1)

    def _sample(self, field: Array, t: float, x: Array, y: Array) -> Array:
        k = int(np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, self.t.size - 2))
        share = float(np.clip((t - self.t[k]) / (self.t[k + 1] - self.t[k]), 0, 1))
        frame = (1 - share) * field[k] + share * field[k + 1]
        return _bilinear(frame, *self._place(x, y))


def beyond(field: Array, layers: int) -> Array:
    """A field [T, Y, X] whose NaN next to numbers become the mean of those, layer by layer; 0."""
    out = field.copy()
    for _ in range(layers):
        padded = np.pad(out, ((0, 0), (1, 1), (1, 1)), constant_values=np.nan)
        known = np.isfinite(padded)
        values = np.where(known, padded, 0.0)
        total, count = (_neighbors(a) for a in (values, known.astype(np.float64)))
        new = np.isnan(out) & (count > 0)
        out[new] = total[new] / count[new]
    return np.nan_to_num(out)


def _neighbors(padded: Array) -> Array:
    """Sum over the eight neighbors of [T, Y + 2, X + 2]."""
    rows = padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]
    total = rows[..., :-2] + rows[..., 1:-1] + rows[..., 2:]
    return np.asarray(total - padded[:, 1:-1, 1:-1])


def _bilinear(frame: Array, column: Array, row: Array) -> Array:
    """Values [n] of a frame [Y, X] at positions in cells, which must lie inside."""
    i = np.minimum(column.astype(int), frame.shape[1] - 2)
    j = np.minimum(row.astype(int), frame.shape[0] - 2)
    a, b = column - i, row - j
    low = (1 - a) * frame[j, i] + a * frame[j, i + 1]
    high = (1 - a) * frame[j + 1, i] + a * frame[j + 1, i + 1]
    return np.asarray((1 - b) * low + b * high)
