r"""The inertial numbers that the vectors of a flow show, without a network.

The pressure in them is an estimate. It follows from the momentum balance along y,
without the stress deviator:

$$ p(h) = \int_h^{h_s} \big(g_{eff}\big)\,\mathrm{d}h', \qquad
   g_{eff} = \max\big(-(g - \mathrm{D}v/\mathrm{D}t) \cdot e_h,\ 0\big): $$

The pressure is hydrostatic below the free surface, with a weight reduced by the acceleration.
Grains in free fall have no weight: without this reduction, I there would be several times too
small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.estimates.facts import Facts
from granpinn.estimates.gradients import Gradients, View

# A cell flows if its shear rate exceeds this, in units of sqrt(|g| / H0) (that of D2 = 0.05, as in
# granpinn/fit/scoring.py), and this many times the shear rate that noise simulates.
RATE_AT_REST = 0.05 * np.sqrt(2)
RATE_OVER_NOISE = 2.5
FLOOR = 0.1  # least pressure, as a part of the weight of half a cell or half a grain


@dataclass(frozen=True, eq=False)
class InertialNumbers:
    """I at every cell and time with a velocity gradient, and whether the grains flow there [K].

    Attributes:
        vectors: vectors of each [K].
        p: estimated pressure, in units of rho |g| H0 [K].
    """

    I: Float64
    flows: Bool
    vectors: Float64
    p: Float64

    def quantiles(self, *levels: float) -> list[float] | None:
        """Quantiles of I over the flowing vectors; None if none flows."""
        I, vectors = self.I[self.flows], self.vectors[self.flows]
        if I.size == 0:
            return None
        order = np.argsort(I)
        share = np.cumsum(vectors[order]) / vectors.sum()
        return [float(I[order][np.searchsorted(share, level)]) for level in levels]


def inertial_numbers(facts: Facts) -> InertialNumbers:
    """The inertial numbers of a flow; a pure function of its vectors."""
    view, found = facts.view, facts.slopes
    least = np.maximum(RATE_AT_REST, RATE_OVER_NOISE * np.sqrt(found.bias))
    p = estimated_pressure(view, found)
    I = inertial_number(view, found, p)
    return InertialNumbers(I, found.gamma_dot > least, found.vectors, p)


def estimated_pressure(view: View, found: Gradients) -> Float64:
    """Pressure at the cells of `found` [K], in units of rho |g| H0, above zero."""
    spacing = view.steps[1]
    weight = np.full(view.grains.shape, -view.gravity[1])
    weight[found.index] += found.acceleration[:, 1]
    weight = np.where(view.grains, weight, 0.0) * spacing
    downwards = weight[:, ::-1]
    pressure = (np.cumsum(downwards, axis=1) - downwards / 2)[:, ::-1]
    least = FLOOR * max(spacing, view.d) / 2
    return np.maximum(pressure[found.index], least)


def inertial_number(view: View, found: Gradients, pressure: Float64) -> Float64:
    """I = d gamma_dot / sqrt(p) at the cells of `found` [K]."""
    return np.asarray(view.d * found.gamma_dot / np.sqrt(pressure))
