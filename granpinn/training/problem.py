"""The scaling of the network, the weights of the loss terms and the constants of the equations.

Only this module scales inputs and outputs. All its results are dimensionless
(granpinn/physics/scales.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from granpinn.arrays import Float64
from granpinn.config import Config, Weights
from granpinn.data import Flow, TrainingSet
from granpinn.data.scaling import material_of
from granpinn.data.symmetry import axes_of, invariant_axes, words
from granpinn.kernels.network import OUTPUTS, NetworkSpec
from granpinn.physics.constants import Physics
from granpinn.physics.scales import Scales
from granpinn.physics.terms import TERMS


@dataclass(frozen=True)
class Problem:
    """The network and the constants of the residuals, as arguments of granpinn.kernels.ops.

    Attributes:
        spec: widths, input map and form of the network.
        term_weights: 1/sigma^2 of each of the `TERMS`.
        mean_length: of the mean strain rate of shear bands (`equations.py`).
    """

    spec: NetworkSpec
    physics: Physics
    term_weights: list[float]
    mean_length: float

    @property
    def symmetries(self) -> tuple[str, ...]:
        """What the network does not depend on, in words."""
        return words(tuple(factor == 0 for factor in self.spec.input_scale))


def build(flow: Flow, scales: Scales, data: TrainingSet, config: Config) -> Problem:
    """The problem of a flow with the settings `config`.

    Inputs in which the flow does not change have the factor 0: no output depends on them.
    """
    if config.network.units == "file":
        shift = [0.0, 0.0, 0.0]
        scale = [scales.length, scales.length, scales.time]
        U_out, P_out = 1 / scales.velocity, 1 / scales.pressure
    else:
        bounds = list(zip(data.lower.tolist(), data.upper.tolist(), strict=True))
        shift = [(low + high) / 2 for low, high in bounds]
        scale = [2 / (high - low) if high > low else 1.0 for low, high in bounds]
        U_out = float(data.velocity.square().mean().sqrt()) or 1.0
        P_out = config.network.pressure_scale
    invariant = invariant_axes(flow)
    scale = [0.0 if same else factor for same, factor in zip(invariant, scale, strict=True)]
    material = material_of(flow, scales)
    g_x, g_y = axes_of(flow).gravity
    physics = Physics(
        grain_diameter=material.grain_diameter,
        g_x=g_x,
        g_y=g_y,
        eta_min=material.eta_min or 0.0,
        eta_max=math.inf if material.eta_max is None else material.eta_max,
        velocity_scale=U_out,
        pressure_scale=P_out,
        pressure_floor=config.rheology.p_floor,
    )
    widths = (3, *config.network.widths, OUTPUTS[config.form])
    spec = NetworkSpec(widths, tuple(shift), tuple(scale), config.form)
    smallest = max(flow.grain_diameter, flow.stated("grid_spacing_of_solver") or 0.0)
    return Problem(spec, physics, _term_weights(config, scales), smallest / scales.length)


def _term_weights(config: Config, scales: Scales) -> list[float]:
    """1/sigma^2 of every term, dimensionless."""
    sigmas = [config.weights.sigma(term.name) for term in TERMS]
    if config.weights.units == "file":
        pairs = zip(sigmas, TERMS, strict=True)
        sigmas = [scales.to_dimensionless(sigma, term.quantity) for sigma, term in pairs]
    return [sigma**-2 for sigma in sigmas]


def velocity_relaxation(
    settings: Weights, weight: npt.ArrayLike, misfit: npt.ArrayLike, done: float
) -> Float64:
    """Factor on the weight of the velocity term of noisy data, 1 for clean data.

    sigma_velocity is the velocity that the network cannot resolve. For noisy data it is too small:
    the strain rate of the network then follows the noise. So sigma rises geometrically over the
    first part `noise_rise` of the stage, to the part `noise_part` of the noise. The whole noise is
    far too large: the friction law then distorts the velocity (bench/studies/noise).

    Args:
        weight: 1/sigma_velocity^2, of one or of many members.
        misfit: rms misfit of one velocity component after the pre-fit, of the same members.
        done: part of the stage after the pre-fit that is over, in [0, 1].
    """
    ratio = settings.noise_part * np.asarray(misfit) * np.sqrt(weight)
    relaxation = np.maximum(1.0, ratio) ** (-2 * min(1.0, done / settings.noise_rise))
    return np.asarray(relaxation, dtype=np.float64)
