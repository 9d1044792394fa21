"""The start-up of Bagnold flow: an even layer on a slope, released from rest. No source term.

tests/simulation/startup.py solves its equations, with an error below 1e-6 on these rows.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from bench.studies.floor.fields import GRAIN, THETA
from bench.studies.floor.sampling import centers
from granpinn.data import Flow
from granpinn.data.flow import PERIOD_X, SURFACE_SD, Surface, Truth
from tests.simulation import startup
from tests.simulation.startup import Layer

SLOPE = math.atan(0.56)
END, CELLS, COLUMNS = 30.0, 1000, 8


def sample(cells: int, frames: int) -> Flow:
    """The exact velocity at the centers of `cells` rows, in `frames` frames after the first."""
    spacing = 1 / cells
    x, y = centers(COLUMNS, spacing), centers(cells + 2, spacing)
    t = np.linspace(0, END, frames + 1)
    c = np.broadcast_to((y < 1)[None, :, None], (t.size, y.size, x.size)).astype(np.float32)
    profile = velocity(frames)(y)
    u = np.where(c == 1, profile[:, :, None], np.nan).astype(np.float32)
    times, places = (a.ravel() for a in np.meshgrid(t, x, indexing="ij"))
    return Flow(
        t=t,
        y=y,
        x=x,
        u=u,
        v=np.where(c == 1, np.float32(0), np.float32(np.nan)),
        c=c,
        gravity=(math.sin(SLOPE), -math.cos(SLOPE)),
        density=1.0,
        grain_diameter=GRAIN,
        surface=Surface(times, places, np.ones_like(times), np.zeros_like(times, np.float32)),
        truth=Truth(*THETA),
        attributes={PERIOD_X: COLUMNS * spacing, SURFACE_SD: 0.0},
    )


@cache
def velocity(frames: int) -> CubicSpline:
    """u [frames + 1, n] as a function of y [n]."""
    layer = Layer(*THETA, GRAIN, math.tan(SLOPE))
    y, u = startup.velocity(layer, np.linspace(0, END, frames + 1), CELLS)
    y, u = np.insert(y, 0, 0.0), np.insert(u, 0, 0.0, axis=1)
    return CubicSpline(y, u, axis=1)
