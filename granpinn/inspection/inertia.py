"""The inertial numbers that the vectors of a flow show, without a network."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Bool, Float64
from granpinn.estimates.facts import Facts
from granpinn.inspection.precision import AssumedLaw
from granpinn.inspection.pressure import estimated_pressure, inertial_number

# A cell flows if its shear rate exceeds this, in units of sqrt(|g| / H0) (that of D2 = 0.05, as in
# granpinn/fit/scoring.py), and this many times the shear rate that noise simulates.
RATE_AT_REST = 0.05 * np.sqrt(2)
RATE_OVER_NOISE = 2.5


@dataclass(frozen=True)
class Inertia:
    """Inertial numbers of the flowing vectors, with the pressure of granpinn/inspection/pressure.

    Attributes:
        q05, q50, q95, q99: quantiles.
        reach: q95 / I0 with the inertial scale I0 of the law; None for a law without one.
        above: share with I > I0 / 3, where mu(I) bends enough to show mu_2; or None.
    """

    q05: float
    q50: float
    q95: float
    q99: float
    reach: float | None
    above: float | None


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

    def summary(self, law: AssumedLaw) -> Inertia | None:
        """The quantiles beside the inertial scale of a law; None if no vector flows."""
        found = self.quantiles(0.05, 0.5, 0.95, 0.99)
        if found is None:
            return None
        q05, q50, q95, q99 = found
        scale = law.inertial_scale
        if scale is None:
            return Inertia(q05, q50, q95, q99, reach=None, above=None)
        weight = self.vectors[self.flows]
        above = float(weight[scale / 3 < self.I[self.flows]].sum() / weight.sum())
        return Inertia(q05, q50, q95, q99, reach=q95 / scale, above=above)


def inertial_numbers(facts: Facts) -> InertialNumbers:
    """The inertial numbers of a flow; a pure function of its vectors."""
    view, found = facts.view, facts.slopes
    least = np.maximum(RATE_AT_REST, RATE_OVER_NOISE * np.sqrt(found.bias))
    p = estimated_pressure(view, found)
    I = inertial_number(view, found, p)
    return InertialNumbers(I, found.gamma_dot > least, found.vectors, p)
