r"""The facts of a flow that its vectors show: speed, shear rate, noise, and symmetries.

Each fact is measured once, when it is first asked for. The magnitudes are rounded to a quarter of
an octave: no tolerance is known better, and the same flow in other units has the same tolerances
(equal distances of neighbors may be sorted in another order).

In a flow of scattered vectors, a parabola in x and y is fitted to each of some vectors and its
nearest neighbors in the same frame. What it leaves is the noise. The random motion of grains about
the mean flow counts as noise. What neighbors share is no part of it: noise.py shows that, where
there are frames enough.

The inertial numbers take an estimate of the pressure. It follows from the momentum balance along y,
without the stress deviator:

$$ p(h) = \int_h^{h_s} \big(g_{eff}\big)\,\mathrm{d}h', \qquad
   g_{eff} = \max\big(-(g - \mathrm{D}v/\mathrm{D}t) \cdot e_h,\ 0\big): $$

The pressure is hydrostatic below the free surface, with a weight reduced by the acceleration.
Grains in free fall have no weight: without this reduction, I there would be several times too
small.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64
from granpinn.data import Flow, known_sd
from granpinn.data.flow import Particles
from granpinn.data.symmetry import invariant_axes
from granpinn.estimates.gradients import Gradients, View, gradients, shear_rate, view_of
from granpinn.estimates.lattice import ROUNDING, lattice_step
from granpinn.estimates.local_fits import quadratic_basis
from granpinn.estimates.noise import Noise, grid_noise, of_pairs
from granpinn.physics.scales import Scales

NEIGHBORS = 24
SAMPLES = 4000
CHI2_MEDIAN = 2 / 9  # the median of chi^2/n is (1 - CHI2_MEDIAN/n)^3 to 1 % from n = 6 on


def particle_vectors(particles: Particles, scales: Scales) -> tuple[Float64, ...]:
    """t, x, y, u, v of scattered vectors, dimensionless, [N] each."""
    points = scales.points_to_dimensionless(particles.x, particles.y, particles.t)
    velocity = [a.astype(np.float64) for a in (particles.u, particles.v)]
    u, v = (scales.to_dimensionless(a, "velocity") for a in velocity)
    return points[:, 2], points[:, 0], points[:, 1], u, v


def particle_fits(
    t: Float64, x: Float64, y: Float64, u: Float64, v: Float64
) -> tuple[Noise, Float64]:
    """The noise of a typical one of scattered vectors, dimensionless, all [N]; and the shear rate
    at some of them, less the part of the noise [S]."""
    found, rates = [], []
    _, size = np.unique(t, return_counts=True)
    order = np.argsort(t, kind="stable")
    starts = np.concatenate([[0], np.cumsum(size)])
    usable = np.flatnonzero(size > NEIGHBORS)
    # Frames spread over the times; within each, vectors spread over their order.
    picked = (
        usable[np.unique(np.linspace(0, usable.size - 1, 40).astype(int))] if usable.size else []
    )
    for k in picked:
        members = order[starts[k] : starts[k + 1]]
        points = np.stack([x[members], y[members]], axis=-1)
        stride = max(1, members.size * len(picked) // SAMPLES)
        centers = np.arange(0, members.size, stride)
        distance, near = scipy.spatial.cKDTree(points).query(points[centers], k=NEIGHBORS)
        reach = np.maximum(distance[:, -1], np.finfo(float).tiny)
        offset = (points[near] - points[centers][:, None]) / reach[:, None, None]
        variance, rate = _local_parabolas(offset, np.stack([u, v], -1)[members][near], reach)
        found.append(variance)
        rates.append(rate)
    if not found:
        return Noise(None, None, None, 1.0), np.empty(0)
    variance = np.concatenate(found)
    typical = np.sqrt(np.median(variance, axis=0))
    noise = Noise(
        sigma=float(np.sqrt(np.mean(typical**2))),
        u=float(typical[0]),
        v=float(typical[1]),
        vectors_per_independent=1.0,
    )
    return noise, np.concatenate(rates)


def _local_parabolas(offset: Float64, velocity: Float64, reach: Float64) -> tuple[Float64, Float64]:
    """Variance about local parabolas [S, 2], scaled to a median of the noise; shear rate [S].

    Args:
        offset: of the neighbors [S, k, 2], in units of the farthest.
        velocity: of the neighbors [S, k, 2].
        reach: distance of the farthest [S].
    """
    basis = quadratic_basis([offset[..., 0], offset[..., 1]])
    inverse = np.linalg.pinv(basis, rcond=1e-8)  # [S, 6, k]
    coefficients = inverse @ velocity
    freedom = basis.shape[1] - basis.shape[2]
    median = (1 - CHI2_MEDIAN / freedom) ** 3
    rest = velocity - basis @ coefficients
    variance: Float64 = np.sum(rest**2, axis=1) / (freedom * median)
    slopes = coefficients[:, 1:3] / reach[:, None, None]  # along x and y, of u and v
    of_noise = np.square(inverse[:, 1:3]).sum(axis=(1, 2)) / reach**2 * variance.sum(axis=1)
    (u_x, v_x), (u_y, v_y) = slopes.transpose(1, 2, 0)
    return variance, shear_rate(u_x, u_y, v_x, v_y, of_noise)


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
    def fits(self) -> tuple[Noise, Float64]:
        """Local fits among the vectors of a flow of particles."""
        return particle_fits(*self.vectors)

    @cached_property
    def noise(self) -> Noise:
        """The noise of a typical vector, at least that of its rounding to a lattice."""
        if self.flow.particles is None:
            return grid_noise(self.view).at_least(self.rounding)
        found = self.fits[0]
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
            some = self.fits[1]
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

    @property
    def independent(self) -> float:
        """Number of independent vectors."""
        particles = self.flow.particles
        count = self.flow.valid.sum() if particles is None else particles.u.size
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
    """

    I: Float64
    flows: Bool
    vectors: Float64

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
    I = view.d * found.gamma_dot / np.sqrt(estimated_pressure(view, found))
    return InertialNumbers(I, found.gamma_dot > least, found.vectors)


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
