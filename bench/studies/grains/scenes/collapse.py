"""Collapse of a column onto a rough bed: the half to the right of a frictionless mirror wall."""

from __future__ import annotations

import numpy as np

from bench.studies.grains.packing import lattice, rough_line
from bench.studies.grains.scenes.scene import Grid, Scene, run


def collapse(width: float, height: float, reach: float, duration: float) -> Scene:
    """A column of a half width and a height; its grains come to rest within `reach`.

    The gate is removed at once. An elastic wave unloads the column; frames before
    0.3 sqrt(height) are dropped.
    """
    frames = round(duration / 0.56)
    return Scene(
        title=f"collapse, height/half width {height / width:g}",
        packing=lambda seed: (
            rough_line((-1, -0.5), (reach, -0.5), seed + 1),
            lattice(0, width, 0, width * height),
        ),
        box=(-2, reach, -2, 1.6 * height),
        stages=(
            "fix mirror free wall/gran WALL_SMOOTH xplane 0 NULL",
            f"fix gate free wall/gran WALL_SMOOTH xplane NULL {width:g}",
            run(1.2 * np.sqrt(height) + 25),
            "unfix gate",
        ),
        grid=Grid(0, reach, 0, 2 * np.ceil(0.5 * height) + 4),
        duration=0.56 * frames,
        snapshots=8 * frames,
        frames=frames,
        dropped=0.3 * float(np.sqrt(height)),
        mirror=True,
        attributes={
            "walls": "y = 0: rough, glued grains, no slip; x = 0: plane of symmetry",
            "column_height": height,
            "column_width": width,
        },
    )
