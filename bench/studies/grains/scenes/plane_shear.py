"""Shear between a fixed bed and a loaded plate that moves: no free surface."""

from __future__ import annotations

import math

from bench.studies.grains.packing import (
    GLUED_DISTANCE,
    LATTICE,
    MOVING,
    SETTLED_AREA,
    lattice,
    rough_line,
)
from bench.studies.grains.scenes.scene import Grid, Scene, run

LENGTH = 50.0
DEPTH = 40.0


def plane_shear(load: float, speed: float, duration: float) -> Scene:
    """A layer of 40 d under a rough plate; gravity makes the pressure grow downwards.

    The plate moves along x at a speed, and up and down under its load: its grains share their mean
    vertical force.
    """
    rows = math.ceil(LENGTH * DEPTH / SETTLED_AREA / int((LENGTH - 0.2) / LATTICE))
    start = LATTICE * (rows + 1.2)
    share = load * LENGTH / round(LENGTH / GLUED_DISTANCE)
    return Scene(
        title=f"plane shear, load {load:g}, speed {speed:g}",
        packing=lambda seed: (
            rough_line((0, -0.5), (LENGTH, -0.5), seed + 1),
            rough_line((0, start), (LENGTH, start), seed + 2, MOVING),
            lattice(0, LENGTH, 0, LENGTH * DEPTH),
        ),
        box=(0, LENGTH, -2, 1.8 * DEPTH),
        boundary="p f p",
        stages=(
            f"fix load moving aveforce NULL {-share:.10g} NULL",
            "fix straight moving setforce 0 NULL 0",
            "fix plate moving nve",
            "fix drag moving viscous 2.0",
            run(40.0),
            f"velocity moving set {speed:g} NULL NULL",
            "unfix drag",
            run(100.0),
        ),
        grid=Grid(0, LENGTH, 0, DEPTH - 4),
        duration=duration,
        snapshots=400,
        frames=2,
        steady=True,
        surface=False,
        attributes={
            "walls": "y = 0: rough, glued grains, no slip; above: a rough plate, periodic along x",
            "period_x": LENGTH,
            "plate_load": load,
            "plate_speed": speed,
        },
    )
