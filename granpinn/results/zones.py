"""Which points of the fields count, which flow, and which are stagnant.

The motion determines the pressure only where the material shears. A mean over all points would hide
the error there. A point flows where D2 >= 0.05 sqrt(|g| / H0); elsewhere it is stagnant (at rest or
in rigid motion). 0.05 is the strain-rate error of a velocity field resolved to about 1 %; below it
the direction of the stress is lost. A quarter of the points of a column collapse are stagnant by
this rule. D2 is spread evenly over the decades around this threshold, so that no threshold is
natural; results.json states it.

For scores, D2 is taken from finite differences of the velocity in the file, so that the zones do
not depend on the network. If the file declares measurement noise (sigma_u, sigma_v), the predicted
D2 is used: differences of noise are large even in grains at rest.
"""

from __future__ import annotations

import numpy as np

from granpinn.arrays import Bool, Floats
from granpinn.results.fields import Fields

D2_STAGNANT = 0.05  # in units of sqrt(|g| / H0)


def after_start(fields: Fields) -> Bool:
    """Points [K] that count: at t = 0 there is no solution to compare with, unless it is steady."""
    return fields.time_of_points() > 0 if not fields.steady else np.ones(fields.index.size, bool)


def flowing(fields: Fields, d2: Floats | None = None) -> Bool:
    """Points [K] whose strain rate (the predicted one unless given, in the file's units) flows.

    A point with an unknown strain rate (NaN) does not count as flowing.
    """
    d2 = fields.values["D2"] if d2 is None else d2
    return np.asarray(d2 * fields.time >= D2_STAGNANT)


def shearing(fields: Fields) -> Bool:
    """Points [K] after the start that flow: the ones that show friction."""
    return np.asarray(after_start(fields) & flowing(fields))
