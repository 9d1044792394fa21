"""Flows of grains down a slope with an exact stress."""

from __future__ import annotations

import math

import numpy as np

from granpinn.data import Flow, Surface

MU_S, MU_2, I0 = 0.3, 0.7, 0.3
SURFACE = 8.0  # height of the layer in grain diameters
TANGENT = 0.40  # of the slope


def number_of(mu: float) -> float:
    """The inertial number of a friction."""
    return I0 * (mu - MU_S) / (MU_2 - mu)


def chute(
    acceleration: float = 0.0, frames: int = 8, columns: int = 9, tangent: float = TANGENT
) -> Flow:
    """Bagnold's flow, u = 2/3 I sqrt(g cos) (H^1.5 - depth^1.5)/d, which speeds up as a whole.

    I is the same everywhere, p = rho g cos (H - y), and tau = (tan - a/(g cos)) p. Density,
    gravity and grain diameter are 1.
    """
    cos = 1 / math.hypot(1, tangent)
    number = number_of(tangent - acceleration / cos)
    y, x, t = (np.arange(n) + 0.5 for n in (40, columns, frames))
    y = y * 0.25
    depth = np.maximum(SURFACE - y, 0)
    u = 2 / 3 * number * math.sqrt(cos) * (SURFACE**1.5 - depth**1.5)
    grains = np.broadcast_to((y < SURFACE)[:, None], (frames, len(y), columns))
    moving = u[:, None] + acceleration * t[:, None, None]
    return Flow(
        t=t,
        y=y,
        x=x,
        u=np.where(grains, moving, np.nan),
        v=np.where(grains, 0.0, np.nan),
        c=grains.astype(np.float32),
        gravity=(tangent * cos, -cos),
        density=1.0,
        grain_diameter=1.0,
        surface=Surface(
            t=np.repeat(t, columns), x=np.tile(x, frames), y=np.full(frames * columns, SURFACE)
        ),
    )
