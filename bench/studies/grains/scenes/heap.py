"""A heap on a rough floor between a wall and an open edge, fed at the wall: steady."""

from __future__ import annotations

import math
from collections.abc import Iterator

from bench.studies.grains.materials import GRAIN_DENSITY, MEAN_AREA, SPREAD
from bench.studies.grains.packing import FREE, Packing, lattice, rough_line
from bench.studies.grains.scenes.scene import Grid, Scene, run

FEED = 16.0  # width of the feed beside the wall
POURED = 4.0  # height of the stripe in which grains appear
FALL = 3.0  # speed with which they appear
EDGE = 4.0  # from the end of the floor: no cells there, grains fall off
SEED = 4711  # of the feed
# LAMMPS pours spheres. With this density they weigh as much as the disks, in the mean.
POURED_DENSITY = GRAIN_DENSITY * MEAN_AREA / (math.pi / 6 * (1 + SPREAD**2))
STEPS = 8  # of the floor, to build the first slope


def heap(length: float, start: float, end: float, flux: float, duration: float) -> Scene:
    """A heap on a floor of a length, from a slope of two heights; a flux of grains feeds it.

    The surface gets the slope at which this flux runs down. Inertial numbers are small below the
    feed, where the flow is deep, and large at the edge, where it is thin. Cells end right of the
    feed, where grains rain down, and left of the edge.
    """
    top = start + 12.0
    fall = math.sqrt(FALL**2 + 2 * POURED) - FALL  # time to leave the stripe
    share = flux * fall * MEAN_AREA / ((FEED - 2) * POURED)
    feed = (
        f"fix feed free pour 10000000 {FREE} {SEED} region feed vol {share:.6g} 200 "
        f"diam range {1 - SPREAD:g} {1 + SPREAD:g} "
        f"dens {POURED_DENSITY:.10f} {POURED_DENSITY:.10f} vel 0 0 {-FALL:g}"
    )
    return Scene(
        title=f"heap, flux {flux:g}",
        packing=lambda seed: (
            rough_line((0, -0.5), (length, -0.5), seed + 1),
            *_stairs(length, start, end),
        ),
        box=(-2, length + 12, -20, max(top + POURED + 2, 2 * start)),
        stages=(
            "fix wall free wall/gran WALL_SMOOTH xplane 0 NULL",
            f"fix gate free wall/gran WALL_SMOOTH xplane NULL {length:g}",
            run(14.0),
            "unfix gate",
            f"region feed block 1 {FEED - 1:g} {top:g} {top + POURED:g} -0.5 0.5",
            feed,
            run(80.0),
            "unfix feed",  # the time of a fix that pours cannot be set back
        ),
        grid=Grid(FEED + 4, length - EDGE, 0, 2 * math.ceil(0.5 * start) + 8),
        duration=duration,
        snapshots=400,
        frames=2,
        steady=True,
        recorded=feed,
        attributes={"walls": "y = 0: rough, glued grains, no slip; left and right are open"},
    )


def _stairs(length: float, start: float, end: float) -> Iterator[Packing]:
    """Lattices of grains, the tallest beside the wall."""
    width = length / STEPS
    for k in range(STEPS):
        height = start + (end - start) * (k + 0.5) / STEPS
        yield lattice(k * width, (k + 1) * width, 0, width * height)
