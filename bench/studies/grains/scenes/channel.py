"""Spheres in a channel between two flat side walls, on a tilted rough floor: steady.

The side walls hold the grains back, so that tau/p falls from tan(slope) at the surface with the
depth: a single steady flow holds a range of I. x points down the slope, y away from the floor, z
from one wall to the other.
"""

from __future__ import annotations

import math

from bench.studies.grains.materials import SPHERES, Material
from bench.studies.grains.packing import block, rough_floor
from bench.studies.grains.scenes.scene import Grid, Scene, gravity, run

LENGTH = 10.0
GAP = 10.0  # between the side walls
DEPTH = 16.0
TANGENT = 0.48
SIDE_FRICTION = 0.1  # of the side walls; grains that roll feel less
START = 0.06  # Bagnold profile of the start: u = START (h^1.5 - (h - y)^1.5)
SEEN = 1.5  # depth to which a camera sees grains behind the wall
COLUMNS = (
    *("x", "y", "z", "vx", "vy", "radius", "mass"),
    *("c_virial[1]", "c_virial[2]", "c_virial[4]", "c_virial[3]"),
    *("f_side[2]", "f_side[3]", "f_side[4]"),  # force of the side walls
)


def channel(material: Material, depth_seen: float, duration: float) -> Scene:
    """The channel, seen through the wall z = 0 to a depth; GAP: the mean over its width."""
    cos = 1 / math.hypot(1, TANGENT)
    tilted = (TANGENT * cos, -cos)
    side = material.wall(SIDE_FRICTION)
    return Scene(
        title=f"channel, tan {TANGENT:g}, seen to {depth_seen:g} d",
        packing=lambda seed: (
            rough_floor(LENGTH, GAP, -0.5, seed + 1),
            block(LENGTH, GAP, DEPTH),
        ),
        box=(0, LENGTH, -2, 2.2 * DEPTH, -0.1, GAP + 0.1),
        boundary="p f f",
        stages=(
            f"fix side free wall/gran {side} zplane 0 {GAP:g} contacts",
            run(20.0),
            f"variable start atom {START:g}*({DEPTH:g}^1.5-((y<{DEPTH:g})*({DEPTH:g}-y))^1.5)",
            "velocity free set v_start NULL NULL sum yes",
            gravity(*tilted),
            run(80.0),
        ),
        gravity=tilted,
        grid=Grid(0, LENGTH, 0, DEPTH + 4, cell=1.0),
        duration=duration,
        snapshots=200,
        frames=2,
        steady=True,
        attributes={
            "walls": "y = 0: rough, glued grains, no slip; z = 0 and z = wall_gap: flat side walls",
            "period_x": LENGTH,
            "slope": TANGENT,
            "wall_gap": GAP,
            "side_friction": SIDE_FRICTION,
            "seen_depth": depth_seen,
        },
        columns=COLUMNS,
        shape=SPHERES,
        view=(0.0, depth_seen),
    )
