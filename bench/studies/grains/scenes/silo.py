"""A flat silo with rough walls that empties through a slit in its floor."""

from __future__ import annotations

import numpy as np

from bench.studies.grains.packing import MOVING, lattice, rough_line
from bench.studies.grains.scenes.scene import Grid, Scene, run


def silo(width: float, height: float, outlet: float, duration: float) -> Scene:
    """A silo around x = 0; the plug of the slit is taken away at the start of the record."""
    half, gap = width / 2, outlet / 2
    frames = round(duration / 0.56)
    return Scene(
        title=f"silo, outlet {outlet:g} d",
        packing=lambda seed: (
            rough_line((-half - 0.5, -0.5), (-half - 0.5, 1.6 * height), seed + 1),
            rough_line((half + 0.5, -0.5), (half + 0.5, 1.6 * height), seed + 2),
            rough_line((-half, -0.5), (-gap, -0.5), seed + 3),
            rough_line((gap, -0.5), (half, -0.5), seed + 4),
            rough_line((-gap, -0.5), (gap, -0.5), seed + 5, MOVING),
            lattice(-half, half, 0, width * height),
        ),
        box=(-half - 3, half + 3, -12, 1.7 * height),
        stages=(run(1.2 * np.sqrt(height) + 25), "delete_atoms group moving compress no"),
        grid=Grid(-half, half, 0, 2 * np.ceil(0.5 * height) + 4),
        inside=lambda x, y: (np.abs(x) < half) & ((y > 0) | (np.abs(x) < gap)),
        duration=0.56 * frames,
        snapshots=8 * frames,
        frames=frames,
        dropped=3.0,
        attributes={
            "walls": "x = -wall_x and x = wall_x: rough, glued grains; y = 0: rough, with a slit",
            "wall_x": half,
            "outlet_width": outlet,
        },
    )
