"""A block of grains that falls from rest."""

from __future__ import annotations

import math

import numpy as np

from granpinn.data import Flow
from tests.flows import make_flow

H, WIDTH, G = 1.0, 0.2, 9.81


def falling(
    acceleration: float = 1.0, degrees: float = 0.0, noise: float = 0.0, seed: int = 0
) -> Flow:
    """The block, 1 m high and 0.2 m wide, with a part of g, in m and s.

    Its velocity has a direction `degrees` from gravity, counter-clockwise; c moves straight down.
    """
    t = np.linspace(0.0, 0.2, 21)
    y, x = (np.arange(60) + 0.5) / 60 * 1.5, (np.arange(12) + 0.5) / 12 * 0.3
    drop = acceleration * G * t**2 / 2
    low = 0.5 - drop
    inside = (y > low[:, None]) & (y < low[:, None] + H)
    c = (inside[:, :, None] & (np.abs(x - 0.15) < WIDTH / 2)).astype(np.float32)
    angle = math.radians(degrees)
    scatter = np.random.default_rng(seed).normal(0, noise, (2, *c.shape))
    u, v = (
        np.where(c == 1, a * acceleration * G * t[:, None, None] + rest, np.nan).astype(np.float32)
        for a, rest in zip((math.sin(angle), -math.cos(angle)), scatter, strict=True)
    )
    return make_flow(t=t, y=y, x=x, u=u, v=v, c=c, p=None, surface=None, grain_diameter=0.005)
