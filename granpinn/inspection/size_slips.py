"""Slips of size: of the grains, of their density, of gravity, of the speeds, of I.

The bounds are those of any laboratory and field, with margins:

- A flow is a continuum from about 10 grains across it; thin layers on slopes flow from 5 on. The
  largest flows of small grains, 2,000 diameters, are columns of a metre of sand.
- Grains fill 0.5 to 0.65 of a dense flow, and disks in a plane up to 0.91 of it.
- On Earth |g| is 9.81 m/s^2. Its part along a plane that leans may be smaller.
- Grains that fall a height H reach sqrt(2 |g| H). Those at a front are pushed, and reach
  sqrt(4 |g| H) without friction (the dam break). Grains that enter the grid may have fallen
  farther.
- Dense flows have I below 1; above, grains collide as in a gas.
"""

from __future__ import annotations

import math

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.scaling import initial_height
from granpinn.inspection.inertia import Inertia
from granpinn.inspection.wording import about, digits
from granpinn.results.slip import IMPOSSIBLE, IMPROBABLE, UNUSUAL, Slip

FEWEST_GRAINS, FEW_GRAINS, FEW_IN_LAYERS, MOST_GRAINS = 2.0, 10.0, 5.0, 2000.0
EMPTY = 0.2  # share of the space that grains fill
EARTH = (0.5, 11.0)  # m/s^2
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
SECONDS = {"s": 1.0, "ms": 1e-3}
# Speeds over that of a free fall: improbable and impossible, in closed flows and in others. A chute
# may be far longer than the grid, but not fall from 10^4 times its height.
CLOSED_FAST, OPEN_FAST = (1.5, 5.0), (10.0, 100.0)
FASTEST = 0.99  # quantile
GAS = 1.0  # median inertial number


def size_slips(flow: Flow) -> list[Slip]:
    """Slips of the constants of the material and of gravity."""
    return [*_grains(flow), *_fraction(flow), *_gravity(flow)]


def _grains(flow: Flow) -> list[Slip]:
    count = initial_height(flow) / flow.grain_diameter
    few = FEW_IN_LAYERS if flow.periodic else FEW_GRAINS
    if few <= count <= MOST_GRAINS:
        return []
    what = "layer is" if flow.periodic else "grains are"
    return [
        Slip(
            IMPOSSIBLE if count < FEWEST_GRAINS else UNUSUAL,
            f"the {what} {digits(count)} diameters high in the first frame, and flows of "
            f"{few:g} to {MOST_GRAINS:,.0f} are usual: check the grain diameter and the scale",
        )
    ]


def _fraction(flow: Flow) -> list[Slip]:
    if flow.grain_density is None:
        return []
    share = flow.density / flow.grain_density
    if share >= EMPTY:
        return []
    return [
        Slip(
            IMPROBABLE,
            f"the grains fill {share:.3g} of the space (density {flow.density:.4g}, of a grain "
            f"{flow.grain_density:.4g}), and 0.5 to 0.65 are usual: check both densities",
        )
    ]


def _gravity(flow: Flow) -> list[Slip]:
    if flow.length_unit not in METRES or flow.time_unit not in SECONDS:
        return []
    unit = METRES[flow.length_unit] / SECONDS[flow.time_unit] ** 2
    g = math.hypot(*flow.gravity) * unit
    if EARTH[0] <= g <= EARTH[1]:
        return []
    return [
        Slip(UNUSUAL, f"gravity is {digits(g)} m/s^2, and 9.81 on Earth: check its size and unit")
    ]


def against_fall(flow: Flow, speeds: Float64, height: float, closed: bool) -> list[Slip]:
    """Speeds that no free fall reaches.

    Args:
        speeds: of all vectors of some frames.
        height: of all places that held grains.
        closed: whether no grains cross the edges of the grid.
    """
    if speeds.size == 0:
        return []
    fall = math.sqrt(2 * math.hypot(*flow.gravity) * height)
    ratio = float(np.quantile(speeds, FASTEST)) / fall
    fast, too_fast = CLOSED_FAST if closed else OPEN_FAST
    if not ratio > fast:
        return []
    return [
        Slip(
            IMPOSSIBLE if ratio > too_fast else IMPROBABLE,
            f"grains move at {about(ratio)} the speed of a free fall through the height of "
            "all grains: check the units of u and v, x and y, and gravity",
        )
    ]


def not_dense(flow: Flow, inertia: Inertia | None) -> list[Slip]:
    """A flow whose inertial numbers are those of a gas, or of far too large grains.

    Args:
        inertia: of the flowing vectors, None if there are none.
    """
    if inertia is None:
        return []
    check = "check the grain diameter, the scale and the frame rate"
    count = initial_height(flow) / flow.grain_diameter
    if not flow.periodic and count < FEW_GRAINS and inertia.q99 > GAS:
        text = (
            f"the grains are {digits(count)} diameters high, and the inertial number reaches "
            f"{inertia.q99:.2g}, where grains collide as in a gas: {check}"
        )
        return [Slip(IMPROBABLE, text)]
    if not inertia.q50 > GAS:
        return []
    text = (
        f"the inertial number is {inertia.q50:.2g} (median), and dense flows have less than "
        f"{GAS:g}: {check}"
    )
    return [Slip(IMPROBABLE, text)]
