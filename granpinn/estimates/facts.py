"""The facts of a flow that its vectors show: speed, shear rate, noise, and symmetries.

Each fact is measured once, when it is first asked for. The magnitudes are rounded to a quarter of
an octave: no tolerance is known better, and the same flow in other units has the same tolerances
(equal distances of neighbors may be sorted in another order).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from granpinn.arrays import Float64
from granpinn.data import Flow, known_sd
from granpinn.data.symmetry import invariant_axes
from granpinn.estimates.gradients import Gradients, View, gradients, view_of
from granpinn.estimates.lattice import ROUNDING, lattice_step
from granpinn.estimates.noise import Noise, grid_noise, of_pairs
from granpinn.estimates.scattered_fits import (
    ParticleFits,
    particle_fits,
    particle_vectors,
)
from granpinn.physics.scales import Scales

FRAMES = 12  # at most, for the shear rate
STEPS = 4  # of an octave, to which magnitudes are rounded
ARRAYS = ("view", "vectors", "fits", "slopes")  # facts of the size of the flow


@dataclass(frozen=True, eq=False)
class Facts:
    """What the vectors of a flow show, dimensionless."""

    flow: Flow
    scales: Scales

    @cached_property
    def invariant(self) -> tuple[bool, bool, bool]:
        """Whether the flow does not change with x, y and t, in the axes of its training."""
        return invariant_axes(self.flow)

    @cached_property
    def columns(self) -> int:
        """Columns of vectors whose mean a flow that is the same along x shows; else 1."""
        return int(self.view.there.any(axis=(0, 1)).sum()) if self.invariant[0] else 1

    @cached_property
    def view(self) -> View:
        """The flow on one grid."""
        return view_of(self.flow, self.scales)

    @cached_property
    def vectors(self) -> tuple[Float64, ...]:
        """t, x, y, u, v of all vectors of a flow of particles, [N] each."""
        assert self.flow.particles is not None
        return particle_vectors(self.flow.particles, self.scales)

    @cached_property
    def fits(self) -> ParticleFits:
        """Local fits among the vectors of a flow of particles."""
        return particle_fits(*self.vectors)

    @cached_property
    def noise(self) -> Noise:
        """The noise of a typical vector, at least that of its rounding to a lattice."""
        if self.flow.particles is None:
            return grid_noise(self.view).at_least(self.rounding)
        found = self.fits.noise
        found = found if self.flow.steady else of_pairs(found, *self.vectors)
        return found.at_least(self.rounding)

    @cached_property
    def rounding(self) -> float:
        """Standard deviation of the rounding of vectors that are multiples of a step, else 0."""
        return ROUNDING * lattice_step(self.flow) / self.scales.velocity

    @cached_property
    def slopes(self) -> Gradients:
        """Derivatives of the velocity in all cells."""
        return gradients(self.view, self.noise.sigma or 0.0)

    @cached_property
    def speed(self) -> float:
        """Rms speed; 1 for grains at rest."""
        if self.flow.particles is None:
            speeds = np.hypot(self.view.u, self.view.v)[self.view.there]
        else:
            speeds = np.hypot(*self.vectors[3:])
        return _rounded(_rms(speeds)) or 1.0

    @cached_property
    def shear_rate(self) -> float:
        """Rms shear rate, less the part of the noise; 1 for grains at rest."""
        if self.flow.particles is None:
            some = gradients(_some_frames(self.view), self.noise.sigma or 0.0).gamma_dot
        else:
            some = self.fits.shear_rate
        return _rounded(_rms(some)) or 1.0

    @cached_property
    def sigma(self) -> float:
        """Noise of one component of one vector: measured; if the vectors are too few, stated."""
        measured = self.noise.sigma
        if measured is None or not math.isfinite(measured):
            measured = known_sd(self.flow) / self.scales.velocity
        return _rounded(measured)

    @property
    def relative_noise(self) -> float:
        """Noise of one component of one vector over the rms speed."""
        return self.sigma / self.speed

    def independent(self, training: int | None = None) -> float:
        """Number of independent vectors.

        Args:
            training: number of vectors that train, where the flow is runs of a large flow.
        """
        particles = self.flow.particles
        count = self.flow.valid.sum() if particles is None else particles.u.size
        if training is not None and self.flow.starts:
            count = training
        return float(count) / self.noise.vectors_per_independent

    def without_arrays(self) -> Facts:
        """These facts without the arrays behind them, which another fact would make again."""
        numbers = {k: v for k, v in vars(self).items() if k not in ARRAYS}
        kept = Facts(self.flow, self.scales)
        vars(kept).update(numbers)
        return kept


def _some_frames(view: View) -> View:
    """Frames spread over the time of the flow; slopes along x and y need no others."""
    k = np.unique(np.linspace(0, len(view.t) - 1, FRAMES).round().astype(int))
    names = ("t", "u", "v", "count", "grains")
    return dataclasses.replace(view, **{name: getattr(view, name)[k] for name in names})


def _rms(values: Float64) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values.size else 0.0


def _rounded(value: float) -> float:
    """To a quarter of an octave; 0 for a value that is not positive."""
    return 2 ** (round(STEPS * math.log2(value)) / STEPS) if value > 0 else 0.0
