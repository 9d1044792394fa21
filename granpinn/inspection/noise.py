"""The noise of the vectors, measured in the data (estimates/noise.py), and what the file states."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.data import Flow
from granpinn.data.noise import max_speed, stated_sigmas
from granpinn.estimates.noise import Noise
from granpinn.inspection import NEGLIGIBLE_NOISE, Inspection
from granpinn.results.record import ADVICE, Check, Reason, Record


@dataclass(frozen=True)
class MeasuredNoise(Noise, Record):
    """The noise in the units of the file, beside what the file states.

    Attributes:
        stated: median of the standard deviation in the file.
        relative: sigma over the largest speed; None if either is unknown.
        speed: the largest one, of the smoothed velocity where there is one: the largest of many
            noisy speeds consists mostly of noise.
        averaged: frames of which the flow is the mean; 1: none.
        unit: behind a number, with a space.
    """

    title = "noise"

    stated: float | None
    relative: float | None
    speed: float
    averaged: int
    unit: str

    @property
    def negligible(self) -> bool:
        return self.relative is None or self.relative < NEGLIGIBLE_NOISE

    @property
    def words(self) -> str:
        if self.sigma is None:
            return "unknown: too few vectors"
        if self.relative is None:
            return "none: nothing moves"
        fastest = f"{self.speed:.3g}{self.unit}"
        if self.negligible:
            return f"below {NEGLIGIBLE_NOISE:.2%} of the largest speed, {fastest}"
        text = f"{self.sigma:.3g}{self.unit} per component = "
        text += f"{self.relative:.2%} of the largest speed, {fastest}"
        if self.vectors_per_independent > 1.5:
            text += f"; {self.vectors_per_independent:.1f} neighbors share one error"
        if self.stated is not None:
            mean = "the mean has a standard error of"
            text += f"; {'the file states' if self.averaged == 1 else mean} {self.stated:.3g}"
        return text

    def reasons(self, of: Inspection) -> list[Reason]:
        if self.negligible or self.sigma is None:
            return []
        error = self.stated
        if not error or self.averaged > 1 or 0.67 < error / self.sigma < 1.5:
            return []
        text = (
            "The file states a standard deviation that the vectors contradict: they scatter "
            f"{self.sigma / error:.2g} times as much. Correct sigma_u and sigma_v."
        )
        return [Reason(ADVICE, text)]


def make(inspection: Inspection) -> MeasuredNoise:
    flow, facts, unit = inspection.flow, inspection.facts, inspection.scales.velocity
    noise, smooth, speed = facts.noise.in_units_of(unit), facts.slopes, max_speed(flow)
    if smooth.u.size:
        speed = min(speed, float(np.hypot(smooth.u, smooth.v).max()) * unit)
    return MeasuredNoise(
        **vars(noise),
        stated=_stated(flow),
        relative=None if noise.sigma is None or not speed > 0 else noise.sigma / speed,
        speed=speed,
        averaged=flow.averaged,
        unit="" if inspection.velocity_unit == "1" else f" {inspection.velocity_unit}",
    )


def _stated(flow: Flow) -> float | None:
    """Median standard deviation that the file states."""
    sigmas = [np.asarray(sigma) for sigma in stated_sigmas(flow)]
    if not all(sigma.any() for sigma in sigmas):
        return None
    used = [sigma[flow.valid] if sigma.ndim == 3 else sigma for sigma in sigmas]
    return math.hypot(*(float(np.median(sigma)) for sigma in used)) / math.sqrt(2)


CHECK = Check("noise", MeasuredNoise, make, seconds=0.03, quick=False)
