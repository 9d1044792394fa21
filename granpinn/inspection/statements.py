"""What a flow file states: usual sizes, and numbers that the flow itself bounds.

Such a statement can be read and used, but it is likely to be in another unit, or of another flow.
The bounds are wide: no sound file of any study comes near them.

- A cell or an averaging length of the solver, and the error of the surface line, are small parts of
  the height of the grains. Side walls are at least a grain apart.
- A measured velocity has an error between 1e-6 times the largest speed and that speed.
- Vectors are multiples of one number only where a program has rounded them.
- Vectors are seldom exactly zero; programs write 0 where they find no vector.
- A steady layer that is the same at every x flows under a free surface only down a slope.

Sizes have the bounds of any laboratory and field, with margins:

- A flow is a continuum from about 10 grains across it; thin layers on slopes flow from 5 on. The
  largest flows of small grains, 2,000 diameters, are columns of a metre of sand.
- Grains fill 0.5 to 0.65 of a dense flow, and disks in a plane up to 0.91 of it.
- On Earth |g| is 9.81 m/s^2. Its part along a plane that leans may be smaller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Float64, Floats
from granpinn.data import Flow, known_sd
from granpinn.data.flow import PERIOD_X, SOLVER_CELL, SOLVER_MEAN, SURFACE_SD, WALL_GAP
from granpinn.data.large import thinned
from granpinn.data.scaling import initial_height
from granpinn.estimates.lattice import ROUNDING, lattice_step
from granpinn.inspection import Inspection, digits
from granpinn.results.record import IMPOSSIBLE, IMPROBABLE, UNUSUAL, Check, Reason, Record

FEWEST_GRAINS, FEW_GRAINS, FEW_IN_LAYERS, MOST_GRAINS = 2.0, 10.0, 5.0, 2000.0
EMPTY = 0.2  # share of the space that grains fill
EARTH = (0.5, 11.0)  # m/s^2
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
SECONDS = {"s": 1.0, "ms": 1e-3}
COARSE, UNSURE = 0.5, 0.3  # cell of the solver and error of the line, over the height
MONOLAYER = 0.9  # distance of side walls over the grain diameter
LONG = 1000.0  # period over the width of the grid
MOST_ZEROS = 0.005  # share of the vectors after the start that are exactly zero
EXACT = 1e-6  # error of a velocity over the largest speed
LEVEL = 0.01  # component of gravity along x, over gravity
ONE_WAY = 0.5  # mean velocity over mean speed


@dataclass(frozen=True)
class Statements(Record):
    """The slips of the statements of a flow."""

    slips: tuple[Reason, ...]

    def reasons(self, of: Inspection) -> list[Reason]:
        return list(self.slips)


def make(inspection: Inspection) -> Statements:
    flow, speeds = inspection.filmed, inspection.speeds
    u, v = _vectors(flow)
    found = [*_sizes(flow), *_lengths(flow), *_errors(flow, speeds), *_level(flow, u, speeds)]
    return Statements((*found, *_zeros(u, v), *_locked(flow, speeds)))


def _sizes(flow: Flow) -> list[Reason]:
    """Of the grains, of their density and of gravity."""
    found, count = [], initial_height(flow) / flow.grain_diameter
    few = FEW_IN_LAYERS if flow.periodic else FEW_GRAINS
    if not few <= count <= MOST_GRAINS:
        text = (
            f"the {'layer is' if flow.periodic else 'grains are'} {digits(count)} diameters high "
            f"in the first frame, and flows of {few:g} to {MOST_GRAINS:,.0f} are usual: check the "
            "grain diameter and the scale"
        )
        found.append(Reason(IMPOSSIBLE if count < FEWEST_GRAINS else UNUSUAL, text))
    share = math.inf if flow.grain_density is None else flow.density / flow.grain_density
    if share < EMPTY:
        text = (
            f"the grains fill {share:.3g} of the space (density {flow.density:.4g}, of a grain "
            f"{flow.grain_density:.4g}), and 0.5 to 0.65 are usual: check both densities"
        )
        found.append(Reason(IMPROBABLE, text))
    if flow.length_unit in METRES and flow.time_unit in SECONDS:
        unit = METRES[flow.length_unit] / SECONDS[flow.time_unit] ** 2
        g = math.hypot(*flow.gravity) * unit
        if not EARTH[0] <= g <= EARTH[1]:
            text = f"gravity is {digits(g)} m/s^2, and 9.81 on Earth: check its size and unit"
            found.append(Reason(UNUSUAL, text))
    return found


def _lengths(flow: Flow) -> list[Reason]:
    height, width, d = initial_height(flow), float(np.ptp(flow.x)), flow.grain_diameter
    of_height = f"the grains are {height:.3g} high"
    bounds = (
        (SOLVER_CELL, IMPROBABLE, 0.0, COARSE * height, of_height),
        (SOLVER_MEAN, IMPROBABLE, 0.0, COARSE * height, of_height),
        (SURFACE_SD, UNUSUAL, 0.0, UNSURE * height, of_height),
        (WALL_GAP, IMPROBABLE, MONOLAYER * d, math.inf, f"a grain is {d:.3g} wide"),
        (PERIOD_X, UNUSUAL, 0.0, LONG * width, f"x spans {width:.3g}"),
    )
    return [
        Reason(severity, f"{name} is {value:.3g}, and {why}: check its unit")
        for name, severity, low, high, why in bounds
        if (value := flow.stated(name)) is not None and not low <= value <= high
    ]


def _errors(flow: Flow, speeds: Float64) -> list[Reason]:
    sd, fastest = known_sd(thinned(flow)), float(speeds.max(initial=0.0))
    if sd == 0 or fastest == 0 or EXACT * fastest <= sd <= fastest:
        return []
    size = "larger than" if sd > fastest else f"{sd / fastest:.1g} of"
    text = (
        f"the standard deviation of the velocity, {sd:.3g}, is {size} the largest speed, "
        f"{fastest:.3g}: check the unit of sigma_u and sigma_v"
    )
    return [Reason(UNUSUAL, text)]


def _level(flow: Flow, u: Floats, speeds: Float64) -> list[Reason]:
    """A steady layer under a free surface that nothing drives along x; a plate may drive others."""
    moves = flow.walls is not None and flow.walls.u is not None and bool(np.any(flow.walls.u))
    layer = flow.steady and flow.periodic and flow.surface is not None
    if not layer or moves or flow.source is not None:
        return []
    along = abs(float(np.mean(u, dtype=np.float64))) if u.size else 0.0
    g_x, g_y = flow.gravity
    if along <= ONE_WAY * float(speeds.mean()) or abs(g_x) > LEVEL * math.hypot(g_x, g_y):
        return []
    text = (
        "the flow is steady and the same at every x, and gravity has no component along x, so that "
        "nothing drives it: give gravity in the axes of the slope (granpinn convert --tilt)"
    )
    return [Reason(IMPROBABLE, text)]


def _zeros(u: Floats, v: Floats) -> list[Reason]:
    """Gaps that look like grains at rest."""
    zeros = int(((u == 0) & (v == 0)).sum())
    if zeros <= MOST_ZEROS * u.size:
        return []
    text = (
        f"{zeros} of {u.size} vectors are exactly zero: if there was no vector, write NaN "
        "(convert: --zeros missing), because a zero looks like grains at rest"
    )
    return [Reason(UNUSUAL, text)]


def _locked(flow: Flow, speeds: Float64) -> list[Reason]:
    """Vectors that the PIV program rounded."""
    step = lattice_step(flow)
    if step == 0:
        return []
    error = ROUNDING * step
    text = (
        f"all vectors are multiples of {step:.3g} (peak locking: whole pixels or parts of one), so "
        f"their noise is at least {error:.2g}, {error / float(speeds.max()):.1%} of the largest "
        "speed: let the PIV program fit the peak to a part of a pixel, or use larger particle "
        "images"
    )
    return [Reason(UNUSUAL, text)]


def _vectors(flow: Flow) -> tuple[Floats, Floats]:
    """u and v of the vectors after the start, of a large flow in some of its frames."""
    if flow.particles is not None:
        later = flow.after_start(flow.particles.t)
        return flow.particles.u[later], flow.particles.v[later]
    some = thinned(flow)
    there = some.valid & some.after_start(some.t)[:, None, None]
    return some.u[there], some.v[there]


CHECK = Check("statements", Statements, make, seconds=0.11)
