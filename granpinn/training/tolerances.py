r"""The standard deviations of the residuals, from the flow itself.

A slow flow needs equations that hold more exactly than a fast one. So the tolerances of the
velocity and of its derivatives are parts of the rms velocity and of the rms shear rate of the flow
(`--weights.units flow`); forces have the unit of gravity, which drives every flow.

Noise raises the tolerance of the velocity. A network resolves a limited number n of independent
values of the velocity. The mean of the N vectors behind each value has the error
$\sigma\sqrt{n/N}$, where N counts independent vectors and $\sigma$ is the noise of one of them.
A smaller tolerance lets the network follow the noise; a much larger one lets the friction law
distort the velocity. n was chosen on flows of grains and on collapses with added noise
(bench/studies/noise/note.md).

The forces between grains fluctuate around those of the law, from place to place. A flow that is the
same along x has a network without x: it solves the equations of the mean over N columns, whose
momentum fluctuates less, by $\sqrt{N}$. The tolerance of the law is the error of the law itself; it
stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from granpinn.config import Config
from granpinn.estimates.facts import Facts
from granpinn.physics.scales import Scales
from granpinn.physics.terms import LAW, TERMS

RESOLVED = 1000.0  # n
MOST_COLUMNS = 25  # more count as so many: the tightest momentum that was tried


@dataclass(frozen=True)
class VelocityNoise:
    """The part of the noise of the vectors that is the tolerance of the velocity, dimensionless.

    Attributes:
        sigma: standard deviation of one component of one vector; 0: none, or unknown.
        share: factor on it, sqrt(n/N), at most 1.
    """

    sigma: float = 0.0
    share: float = 1.0

    @classmethod
    def of(cls, facts: Facts, training: int | None = None) -> VelocityNoise:
        """Of a flow, from its measured noise, for a number of vectors as of `Facts.independent`."""
        share = min(1.0, math.sqrt(RESOLVED / max(1.0, facts.independent(training))))
        return cls(facts.sigma, share)

    def factor(self, weight: float, misfit: float) -> float:
        """Factor on the weight of the velocity after the pre-fit, 1 for clean data.

        The noise counts as at most the misfit of the pre-fit. It is smaller than the measured noise
        where frames are too far apart for a measurement, and the network still fits the vectors.

        Args:
            weight: 1/sigma^2 of the velocity without noise.
            misfit: rms misfit of one velocity component after the pre-fit; 0: unknown.
        """
        sigma = self.share * min(self.sigma, misfit or math.inf)
        return max(1.0, sigma * math.sqrt(weight)) ** -2


NO_NOISE = VelocityNoise()


def sigmas_of(config: Config, scales: Scales, facts: Facts) -> list[float]:
    """The standard deviation of every term of the loss, dimensionless."""
    sigmas = [config.weights.sigma(term.name) for term in TERMS]
    if config.weights.units == "file":
        pairs = zip(sigmas, TERMS, strict=True)
        return [scales.to_dimensionless(sigma, term.quantity) for sigma, term in pairs]
    if config.weights.units == "flow":
        unit = {
            "velocity": facts.speed,
            "rate": facts.shear_rate,
            "force": min(facts.columns, MOST_COLUMNS) ** -0.5,
        }
        return [s * unit.get(term.quantity, 1.0) for s, term in zip(sigmas, TERMS, strict=True)]
    return sigmas


def law_rate(sigmas: Sequence[float], law_error: float) -> float:
    """The shear rate above which the law counts by its relative error, dimensionless."""
    sigma = sigmas[LAW]
    return sigma / law_error if law_error > 0 and math.isfinite(sigma) else math.inf
