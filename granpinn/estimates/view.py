"""A flow of either layout on one dimensionless grid: means of the vectors in every cell."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from granpinn.arrays import Bool, Float32, Float64, nearest
from granpinn.data import Flow
from granpinn.data.scaling import equation_constants
from granpinn.physics.scales import Scales

BETWEEN_RUNS = 4  # the largest half-width of a window in gradients.py


@dataclass(frozen=True, eq=False)
class View:
    """A flow in units of H0 and sqrt(|g| H0).

    Between two runs of frames (`Flow.starts`) lie `BETWEEN_RUNS` frames without vectors, so that no
    difference and no window of cells joins the end of one run to the start of the next.

    Attributes:
        t, y, x: time [T] and cell centers [Y], [X].
        u, v: velocity [T, Y, X], 0 in cells without vectors.
        count: vectors per cell [T, Y, X]: 0 or 1 on a grid, any number for particles.
        grains: cells full of grains [T, Y, X].
        gravity: unit vector.
        d: grain diameter of the inertial number (`granpinn.physics.scales.EquationConstants`).
        steady: whether all frames show one flow.
    """

    t: Float64
    y: Float64
    x: Float64
    u: Float64
    v: Float64
    count: Float64
    grains: Bool
    gravity: tuple[float, float]
    d: float
    steady: bool

    @property
    def there(self) -> Bool:
        """Cells that hold at least one vector."""
        there: Bool = self.count > 0
        return there

    @property
    def steps(self) -> tuple[float, float, float]:
        """Median spacing in t, y and x; that of t is infinite for one frame."""
        y, x = (float(np.median(np.diff(axis))) for axis in (self.y, self.x))
        return float(np.median(np.diff(self.t))) if self.t.size > 1 else math.inf, y, x


def view_of(flow: Flow, scales: Scales) -> View:
    """The flow as a View; a cell has the mean of the particles in it."""
    material = equation_constants(flow, scales)
    x_0, y_0, t_0 = scales.origin
    count = flow.valid.astype(np.float64) if flow.particles is None else _counts(flow)
    there = count > 0

    def velocity(values: Float32) -> Float64:
        scaled = scales.to_dimensionless(values.astype(np.float64), "velocity")
        return _apart(np.where(there, scaled, 0.0), flow.starts)

    return View(
        t=scales.points_to_dimensionless(x_0, y_0, _times(flow))[:, 2],
        y=scales.points_to_dimensionless(x_0, flow.y, t_0)[:, 1],
        x=scales.points_to_dimensionless(flow.x, y_0, t_0)[:, 0],
        u=velocity(flow.u),
        v=velocity(flow.v),
        count=_apart(count, flow.starts),
        grains=_apart(flow.material, flow.starts),
        gravity=material.gravity,
        d=material.grain_diameter,
        steady=flow.steady,
    )


Frames = TypeVar("Frames", Float64, Bool)


def _apart(values: Frames, starts: tuple[int, ...]) -> Frames:
    """Values of frames [T, ...] with zeros between the runs."""
    if not starts:
        return values
    found: Frames = np.insert(values, np.repeat(starts[1:], BETWEEN_RUNS), 0, axis=0)
    return found


def _times(flow: Flow) -> Float64:
    """Times of the frames of a view, evenly spaced between the runs."""
    if not flow.starts:
        return flow.t
    frames = np.arange(flow.t.size)
    place = frames + BETWEEN_RUNS * np.searchsorted(flow.starts[1:], frames, side="right")
    return np.asarray(np.interp(np.arange(place[-1] + 1), place, flow.t))


def _counts(flow: Flow) -> Float64:
    """Particles in each cell of the view [T, Y, X]."""
    assert flow.particles is not None
    place = [
        nearest(axis, values)
        for axis, values in (
            (flow.t, flow.particles.t),
            (flow.y, flow.particles.y),
            (flow.x, flow.particles.x),
        )
    ]
    index = np.ravel_multi_index(tuple(place), flow.c.shape)
    count = np.bincount(index, minlength=flow.c.size).reshape(flow.c.shape)
    return np.where(np.isfinite(flow.u), count, 0).astype(np.float64)
