"""A rough drum, half full, that turns slowly: steady, with a nearly flat inclined surface."""

from __future__ import annotations

import math

import numpy as np

from bench.studies.grains.packing import disk, rough_circle
from bench.studies.grains.scenes.scene import Grid, Scene, run

RADIUS = 40.0


def drum(rate: float, duration: float, filmed: int = 0) -> Scene:
    """A drum around the origin that turns counterclockwise at a rate.

    Args:
        filmed: frames of a film; 0: the means over the two halves of the record.
    """
    edge = RADIUS + 0.5
    return Scene(
        title=f"drum, {rate:g} sqrt(g/d){', filmed' if filmed else ''}",
        packing=lambda seed: (
            rough_circle(edge, seed + 1),
            disk(RADIUS, 0.5 * math.pi * RADIUS**2),
        ),
        box=(-RADIUS - 3, RADIUS + 3, -RADIUS - 3, RADIUS + 3),
        stages=(
            run(25.0),
            f"fix turn moving move rotate 0 0 0 0 0 1 {2 * math.pi / rate:g}",
            run(2.8 / rate),
        ),
        grid=Grid(-RADIUS, RADIUS, -RADIUS, RADIUS),
        inside=lambda x, y: np.hypot(x, y) < RADIUS,
        duration=duration,
        snapshots=400,
        frames=filmed or 2,
        steady=True,
        filmed=filmed > 0,
        attributes={
            "walls": "circle around the origin: rough, glued grains, turns as a solid",
            "wall_radius": RADIUS,
            "wall_rotation": rate,
        },
    )
