"""Sizes of the grains, of their density and of gravity.

The bounds are those of any laboratory and field, with margins:

- A flow is a continuum from about 10 grains across it; thin layers on slopes flow from 5 on. The
  largest flows of small grains, 2,000 diameters, are columns of a metre of sand.
- Grains fill 0.5 to 0.65 of a dense flow, and disks in a plane up to 0.91 of it.
- On Earth |g| is 9.81 m/s^2. Its part along a plane that leans may be smaller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from granpinn.data.scaling import initial_height
from granpinn.inspection import Inspection, digits
from granpinn.results.record import IMPOSSIBLE, IMPROBABLE, UNUSUAL, Check, Reason, Record

FEWEST_GRAINS, FEW_GRAINS, FEW_IN_LAYERS, MOST_GRAINS = 2.0, 10.0, 5.0, 2000.0
EMPTY = 0.2  # share of the space that grains fill
EARTH = (0.5, 11.0)  # m/s^2
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
SECONDS = {"s": 1.0, "ms": 1e-3}


@dataclass(frozen=True)
class Sizes(Record):
    """
    Attributes:
        grains: height of the grains in the first frame, in diameters.
        layer: whether the flow is a layer with periodic sides.
        density, grain_density: of the flow and of a grain, if it is stated.
        gravity: its size in m/s^2; None without units.
    """

    grains: float
    layer: bool
    density: float
    grain_density: float | None
    gravity: float | None

    def reasons(self, of: Inspection) -> list[Reason]:
        found = []
        few = FEW_IN_LAYERS if self.layer else FEW_GRAINS
        if not few <= self.grains <= MOST_GRAINS:
            text = (
                f"the {'layer is' if self.layer else 'grains are'} {digits(self.grains)} diameters "
                f"high in the first frame, and flows of {few:g} to {MOST_GRAINS:,.0f} are usual: "
                "check the grain diameter and the scale"
            )
            found.append(Reason(IMPOSSIBLE if self.grains < FEWEST_GRAINS else UNUSUAL, text))
        if self.grain_density is not None and self.density / self.grain_density < EMPTY:
            text = (
                f"the grains fill {self.density / self.grain_density:.3g} of the space (density "
                f"{self.density:.4g}, of a grain {self.grain_density:.4g}), and 0.5 to 0.65 are "
                "usual: check both densities"
            )
            found.append(Reason(IMPROBABLE, text))
        if self.gravity is not None and not EARTH[0] <= self.gravity <= EARTH[1]:
            text = (
                f"gravity is {digits(self.gravity)} m/s^2, and 9.81 on Earth: check its size and "
                "unit"
            )
            found.append(Reason(UNUSUAL, text))
        return found


def make(inspection: Inspection) -> Sizes:
    flow, gravity = inspection.filmed, None
    if flow.length_unit in METRES and flow.time_unit in SECONDS:
        unit = METRES[flow.length_unit] / SECONDS[flow.time_unit] ** 2
        gravity = math.hypot(*flow.gravity) * unit
    grains = initial_height(flow) / flow.grain_diameter
    return Sizes(grains, flow.periodic, flow.density, flow.grain_density, gravity)


CHECK = Check("sizes", Sizes, make, seconds=0.1)
