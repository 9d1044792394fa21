r"""The standard deviations of the residuals, from the flow itself.

A slow flow needs equations that hold more exactly than a fast one. So the tolerances of the
velocity and of its derivatives are parts of the rms velocity and of the rms shear rate of the flow
(`--weights.units flow`); forces have the unit of gravity, which drives every flow.

Noise raises the tolerance of the velocity. A network resolves a limited number n of independent
values of the velocity. The mean of the N vectors behind each value has the error
$\sigma\sqrt{n/N}$, where N counts independent vectors and $\sigma$ is the noise of one of them.
A smaller tolerance lets the network follow the noise; a much larger one lets the friction law
distort the velocity. n was chosen on flows of grains and on collapses with added noise
(bench/studies/grains/note.md).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granpinn.arrays import Float64
from granpinn.config import Config
from granpinn.data import Flow, known_sd
from granpinn.estimates.gradients import gradients
from granpinn.estimates.noise import grid_noise, particle_fits, particle_vectors
from granpinn.estimates.view import View, view_of
from granpinn.physics.scales import Scales
from granpinn.physics.terms import LAW, TERMS

RESOLVED = 3000.0  # n
FRAMES = 12  # at most, for the shear rate
STEPS = 4  # of an octave, to which magnitudes are rounded


@dataclass(frozen=True)
class Magnitudes:
    """How fast a flow is and how noisy its vectors are, dimensionless.

    Attributes:
        velocity: rms speed.
        rate: rms shear rate, less the part of the noise.
        noise: standard deviation of one component of one vector; 0: unknown.
        share: part of the noise that is the tolerance of the velocity.
    """

    velocity: float
    rate: float
    noise: float
    share: float


def magnitudes_of(flow: Flow, scales: Scales) -> Magnitudes:
    """Speed, shear rate and noise of the vectors of a flow.

    The noise is measured from the vectors; where they are too few, it is the stated one.
    """
    if flow.particles is not None:
        t, x, y, u, v = particle_vectors(flow.particles, scales)
        around = particle_fits(t, x, y, u, v)
        found, rate = around.noise, _rms(around.shear_rate)
        speed, vectors = _rms(np.hypot(u, v)), float(u.size)
    else:
        view = view_of(flow, scales)
        found, vectors = grid_noise(view), float(view.count.sum())
        slopes = gradients(_some_frames(view), found.sigma or 0.0)
        rate = _rms(slopes.gamma_dot)
        speed = _rms(np.hypot(view.u, view.v)[view.there])
    noise = found.sigma
    if noise is None or not math.isfinite(noise):
        noise = known_sd(flow) / scales.velocity
    independent = vectors / found.vectors_per_independent
    return Magnitudes(
        velocity=_rounded(speed) or 1.0,
        rate=_rounded(rate) or 1.0,
        noise=_rounded(noise),
        share=min(1.0, math.sqrt(RESOLVED / max(1.0, independent))),
    )


def sigmas_of(config: Config, scales: Scales, found: Magnitudes) -> list[float]:
    """The standard deviation of every term of the loss, dimensionless."""
    sigmas = [config.weights.sigma(term.name) for term in TERMS]
    if config.weights.units == "file":
        pairs = zip(sigmas, TERMS, strict=True)
        return [scales.to_dimensionless(sigma, term.quantity) for sigma, term in pairs]
    if config.weights.units == "flow":
        unit = {"velocity": found.velocity, "rate": found.rate}
        return [s * unit.get(term.quantity, 1.0) for s, term in zip(sigmas, TERMS, strict=True)]
    return sigmas


def law_rate(sigmas: Sequence[float], law_error: float) -> float:
    """The shear rate above which the law counts by its relative error, dimensionless."""
    sigma = sigmas[LAW]
    return sigma / law_error if law_error > 0 and math.isfinite(sigma) else math.inf


def _some_frames(view: View) -> View:
    """Frames spread over the time of the flow; slopes along x and y need no others."""
    k = np.unique(np.linspace(0, len(view.t) - 1, FRAMES).round().astype(int))
    names = ("t", "u", "v", "count", "grains")
    return dataclasses.replace(view, **{name: getattr(view, name)[k] for name in names})


def _rms(values: Float64) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values.size else 0.0


def _rounded(value: float) -> float:
    """To a quarter of an octave, so that the same flow in other units has the same tolerances.

    No tolerance is known better, and equal distances of neighbors may be sorted in another order.
    """
    return 2 ** (round(STEPS * math.log2(value)) / STEPS) if value > 0 else 0.0
