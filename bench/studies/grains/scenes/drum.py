"""A rough drum, half full, that turns slowly: steady, with a nearly flat inclined surface."""

from __future__ import annotations

import math

import numpy as np

from bench.studies.grains.packing import disk, rough_circle
from bench.studies.grains.scenes.scene import Grid, Scene, run

RADIUS = 40.0


def drum(rate: float, duration: float) -> Scene:
    """A drum around the origin that turns counterclockwise at a rate."""
    edge = RADIUS + 0.5
    return Scene(
        title=f"drum, {rate:g} sqrt(g/d)",
        packing=lambda seed: (
            rough_circle(edge, seed + 1),
            disk(RADIUS, 0.5 * math.pi * RADIUS**2),
        ),
        box=(-RADIUS - 3, RADIUS + 3, -RADIUS - 3, RADIUS + 3),
        boundary="f f p",
        stages="\n".join(
            (
                run(25.0),
                f"fix turn moving move rotate 0 0 0 0 0 1 {2 * math.pi / rate:g}",
                run(2.8 / rate),
            )
        ),
        gravity=(0.0, -1.0),
        grid=Grid(-RADIUS, RADIUS, -RADIUS, RADIUS),
        inside=lambda x, y: np.hypot(x, y) < RADIUS,
        duration=duration,
        snapshots=400,
        frames=2,
        steady=True,
        attributes={
            "walls": "circle around the origin: rough, glued grains, turns as a solid",
            "wall_radius": RADIUS,
            "wall_rotation": rate,
        },
    )
