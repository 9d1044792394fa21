"""Shear and volume: where the grains flow, and whether they keep their volume there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granpinn.inspection import Inspection
from granpinn.results.record import ADVICE, Check, Reason, Record

# Of the shear rate. PIV of an incompressible flow left 8 % (bench/studies/experiment).
PIV_DIVERGENCE, LARGE_DIVERGENCE = 0.08, 0.12


@dataclass(frozen=True)
class ShearRate(Record):
    """
    Attributes:
        window: cells across the windows in which velocities were differentiated.
        flowing: share of the vectors in cells that flow.
        shear_rate: its median in these cells.
        shear_rate_error: median of its standard deviation.
        divergence: rms of div v over rms of the shear rate, both where it flows, less noise.
    """

    title = "flowing"

    window: int
    flowing: float
    shear_rate: float | None
    shear_rate_error: float
    divergence: float | None

    @property
    def words(self) -> str:
        text = f"{self.flowing:.0%} of the vectors"
        if self.shear_rate is None:
            return text
        return (
            f"{text}, shear rate {self.shear_rate:.3g} (median, error {self.shear_rate_error:.2g}; "
            f"windows of {self.window} cells), div v {self.divergence:.0%} of it"
        )

    def reasons(self, of: Inspection) -> list[Reason]:
        if self.divergence is None or self.divergence <= LARGE_DIVERGENCE:
            return []
        text = (
            f"div v is {self.divergence:.0%} of the shear rate, and PIV of an incompressible flow "
            f"left {PIV_DIVERGENCE:.0%}: vectors at edges are wrong, grains leave the plane, their "
            "density changes, or x and y have different scales."
        )
        return [Reason(ADVICE, text)]


def make(inspection: Inspection) -> ShearRate:
    found, flows, time = inspection.facts.slopes, inspection.inertia.flows, inspection.scales.time
    gamma_dot, weight, divergence = found.gamma_dot[flows], found.vectors.sum(), None
    if flows.any():
        # var(u_x + v_y) of noise is the sum of both, half of what gamma_dot^2 has.
        square = float(np.mean(found.divergence[flows] ** 2 - found.bias[flows] / 2))
        divergence = float(np.sqrt(max(square, 0.0) / np.mean(gamma_dot**2)))
    error = float(np.sqrt(np.median(found.bias) / 2)) if found.u.size else 0.0
    return ShearRate(
        window=2 * found.half_width + 1,
        flowing=float(found.vectors[flows].sum() / weight) if weight else 0.0,
        shear_rate=float(np.median(gamma_dot)) / time if flows.any() else None,
        shear_rate_error=error / time,
        divergence=divergence,
    )


CHECK = Check("shear", ShearRate, make, seconds=0.07, quick=False)
