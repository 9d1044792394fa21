r"""The scaling of the network, the weights of the loss terms and the constants of the equations.

Only this module scales inputs and outputs. All its results are dimensionless
(granpinn/physics/scales.py).

The standard deviations of the residuals come from the flow itself. A slow flow needs equations that
hold more exactly than a fast one. So the tolerances of the velocity and of its derivatives are
parts of the rms velocity and of the rms shear rate of the flow (`--units flow`); forces
have the unit of gravity, which drives every flow.

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
from dataclasses import dataclass, replace

from granpinn.config import Config
from granpinn.data import Flow
from granpinn.data.flow import SOLVER_CELL, SOLVER_MEAN, WALL_GAP, WINDOW
from granpinn.data.scaling import inertial_diameter, side_wall_of
from granpinn.data.symmetry import axes_of, words
from granpinn.estimates.facts import Facts
from granpinn.kernels.network import OUTPUTS, NetworkSpec
from granpinn.physics.constants import AT_REST, Physics
from granpinn.physics.scales import Scales
from granpinn.physics.terms import LAW, TERMS
from granpinn.training.points import TrainingSet

RESOLVED = 1000.0  # n
MOST_COLUMNS = 25  # more count as so many: the tightest momentum that was tried


def resolved_share(facts: Facts) -> float:
    """The part sqrt(n/N) of the noise of a vector that is the tolerance of the velocity."""
    return min(1.0, math.sqrt(RESOLVED / max(1.0, facts.independent)))


def sigmas_of(config: Config, scales: Scales, facts: Facts) -> list[float]:
    """The standard deviation of every term of the loss, dimensionless."""
    sigmas = [config.weights.sigma(term.name) for term in TERMS]
    if config.units == "file":
        pairs = zip(sigmas, TERMS, strict=True)
        return [scales.to_dimensionless(sigma, term.quantity) for sigma, term in pairs]
    unit = {
        "velocity": facts.speed,
        "rate": facts.shear_rate,
        "force": min(facts.columns, MOST_COLUMNS) ** -0.5,
    }
    return [s * unit.get(term.quantity, 1.0) for s, term in zip(sigmas, TERMS, strict=True)]


def law_rate(sigmas: Sequence[float], law_error: float) -> float:
    """The shear rate above which the law counts by its relative error, dimensionless."""
    sigma = sigmas[LAW]
    return sigma / law_error if law_error > 0 and math.isfinite(sigma) else math.inf


@dataclass(frozen=True)
class Problem:
    """The network and the constants of the residuals, as arguments of granpinn.kernels.ops.

    Attributes:
        spec: widths, input map and form of the network.
        term_weights: 1/sigma^2 of each of the `TERMS`.
        mean_length: of the mean strain rate of shear bands (`equations.py`).
        noise: standard deviation of one component of one vector, dimensionless; 0: none, or the
            training does not follow it.
        share: factor on it, at most 1.
        window: side of the squares over which each vector is a mean; 0: it is a value at a point.
        pressure_unit: the dimensionless pressure 1 in the units of the flow file.
    """

    spec: NetworkSpec
    physics: Physics
    term_weights: list[float]
    mean_length: float
    noise: float = 0.0
    share: float = 1.0
    pressure_unit: float = 1.0
    window: float = 0.0

    def velocity_factor(self, misfit: float) -> float:
        """Factor on the weight of the velocity after the pre-fit, 1 for clean data.

        The noise counts as at most the misfit of the pre-fit. It is smaller than the measured noise
        where frames are too far apart for a measurement, and the network still fits the vectors.

        Args:
            misfit: rms misfit of one velocity component after the pre-fit; 0: unknown.
        """
        sigma = self.share * min(self.noise, misfit or math.inf)
        return max(1.0, sigma * math.sqrt(self.term_weights[0])) ** -2

    @property
    def symmetries(self) -> tuple[str, ...]:
        """What the network does not depend on, in words."""
        return words(tuple(factor == 0 for factor in self.spec.input_scale))


def build(facts: Facts, data: TrainingSet, config: Config) -> Problem:
    """The problem of a flow, by its facts, with the settings `config`.

    Inputs in which the flow does not change have the factor 0: no output depends on them.
    """
    flow, scales = facts.flow, facts.scales
    if config.units == "file":
        shift = [0.0, 0.0, 0.0]
        scale = [scales.length, scales.length, scales.time]
        U_out, P_out = 1 / scales.velocity, 1 / scales.pressure
    else:
        bounds = list(zip(data.lower.tolist(), data.upper.tolist(), strict=True))
        shift = [(low + high) / 2 for low, high in bounds]
        scale = [2 / (high - low) if high > low else 1.0 for low, high in bounds]
        U_out = float(data.velocity.square().mean().sqrt()) or 1.0
        P_out = config.network.pressure_scale
    scale = [0.0 if same else f for same, f in zip(facts.invariant, scale, strict=True)]
    sigmas = sigmas_of(config, scales, facts)
    g_x, g_y = axes_of(flow).gravity
    between_walls = flow.stated(WALL_GAP) is not None
    physics = Physics(
        grain_diameter=inertial_diameter(flow, scales),
        g_x=g_x,
        g_y=g_y,
        eta_min=scales.to_dimensionless(flow.eta_min or 0.0, "viscosity"),
        eta_max=scales.to_dimensionless(
            math.inf if flow.eta_max is None else flow.eta_max, "viscosity"
        ),
        velocity_scale=U_out,
        pressure_scale=P_out,
        pressure_floor=config.rheology.p_floor,
        law_rate=law_rate(sigmas, config.weights.law_error),
        side_wall=side_wall_of(flow, scales, config.side_walls.friction),
        side_wall_speed=AT_REST * facts.speed if between_walls else 1.0,
        v_factor=0.0 if facts.invariant[0] else 1.0,
    )
    widths = (3, *config.network.widths, OUTPUTS[config.form])
    spec = NetworkSpec(widths, tuple(shift), tuple(scale), config.form)
    return Problem(
        spec,
        physics,
        [sigma**-2 for sigma in sigmas],
        mean_length_of(flow) / scales.length,
        facts.sigma if config.weights.follow_noise else 0.0,
        resolved_share(facts),
        scales.pressure,
        (flow.stated(WINDOW) or 0.0) / scales.length,
    )


def mean_length_of(flow: Flow) -> float:
    """Length L of the mean strain rate of shear bands (`equations.py`), in the unit of x.

    It is the one that the flow states for the solver that made it. Of a solver of which only the
    cell is stated, central differences over two cells are supposed; to second order their mean is
    that of L = sqrt(2/3) cells. Other flows are grains, and L is their diameter.
    """
    if stated := flow.stated(SOLVER_MEAN):
        return stated
    cell = flow.stated(SOLVER_CELL)
    return math.sqrt(2 / 3) * cell if cell else flow.grain_diameter


def with_wall_friction(problem: Problem, flow: Flow, scales: Scales, friction: float) -> Problem:
    """The same problem with another friction mu_w of the side walls; nothing else changes."""
    constants = problem.physics._replace(side_wall=side_wall_of(flow, scales, friction))
    return replace(problem, physics=constants)
