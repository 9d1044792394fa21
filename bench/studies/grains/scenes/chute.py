"""A layer on a tilted rough bed, periodic along the bed: from rest, or steady."""

from __future__ import annotations

import math

from bench.studies.grains.materials import I0, Material
from bench.studies.grains.packing import lattice, rough_line
from bench.studies.grains.scenes.scene import Grid, Scene, gravity, run

LENGTH = 64.0
DEPTH = 40.0
# Guesses of mu_s and mu_2 by material, only to start the steady chute near its profile.
GUESS = {0.2: (0.22, 0.72), 0.4: (0.257, 0.738), 0.7: (0.27, 0.78)}


def chute(material: Material, tangent: float, steady: bool, duration: float) -> Scene:
    """A layer of 40 d on a slope; x points down the slope, y away from the bed."""
    cos = 1 / math.hypot(1, tangent)
    tilted = (tangent * cos, -cos)
    stages = [run(35.0)]
    if steady:
        stages += [_bagnold(GUESS[material.friction], tangent, cos), gravity(*tilted), run(110.0)]
    else:
        stages += [gravity(*tilted)]
    frames = 2 if steady else round(duration / 2)
    return Scene(
        title=f"chute, tan {tangent:g}, {'steady' if steady else 'from rest'}",
        packing=lambda seed: (
            rough_line((0, -0.5), (LENGTH, -0.5), seed + 1),
            lattice(0, LENGTH, 0, LENGTH * DEPTH),
        ),
        box=(0, LENGTH, -2, 2.2 * DEPTH),
        boundary="p f p",
        stages=stages,
        gravity=tilted,
        grid=Grid(0, LENGTH, 0, DEPTH + 10),
        duration=duration,
        snapshots=400 if steady else 8 * frames,
        frames=frames,
        steady=steady,
        attributes={
            "walls": "y = 0: rough, glued grains, no slip; periodic along x",
            "period_x": LENGTH,
            "slope": tangent,
        },
    )


def _bagnold(guess: tuple[float, float], tangent: float, cos: float) -> str:
    """Velocity u = 2/3 I sqrt(phi g cos) (h^1.5 - (h - y)^1.5) at the guessed I."""
    ratio = (tangent - guess[0]) / (guess[1] - tangent)
    factor = 2 / 3 * I0 * max(ratio, 0.02) * math.sqrt(cos)
    h = DEPTH + 1
    return (
        f"variable bagnold atom {factor:g}*({h:g}^1.5-((y<{h:g})*({h:g}-y))^1.5)\n"
        "velocity free set v_bagnold NULL NULL sum yes"
    )
