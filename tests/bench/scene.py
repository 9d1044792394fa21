"""Simple flows for the imaginary camera."""

from __future__ import annotations

import numpy as np

from bench.studies.experiment.velocity_field import VelocityField
from granpinn.data import Flow, Surface

SIDE = 64  # cells of size 1
TIMES = np.linspace(0.0, 2.0, 5)


def field(u: object, v: object, top: float = np.inf) -> VelocityField:
    """Velocities u, v (numbers or functions of x, y, t) below y = top."""
    centers = np.arange(SIDE) + 0.5
    t, y, x = np.meshgrid(TIMES, centers, centers, indexing="ij")
    values = [
        np.broadcast_to(f(x, y, t) if callable(f) else f, t.shape).astype(np.float64)
        for f in (u, v)
    ]
    c = np.clip(top - y + 0.5, 0, 1)
    arrays = [np.where(c == 1, a, np.nan).astype(np.float32) for a in values]
    line = Surface(TIMES[:1], centers[:1], centers[:1])
    flow = Flow(
        TIMES,
        centers,
        centers,
        *arrays,
        c.astype(np.float32),
        gravity=(0, -1),
        density=1,
        grain_diameter=1,
        surface=line,
    )
    return VelocityField(flow)
