"""What training needs besides the data: the scaling of the network and the weights of the terms.

This is the one place that decides how inputs and outputs are scaled. All numbers that leave it are
dimensionless (scales.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.config import Config
from granpinn.data import Flow, TrainingSet
from granpinn.network import OUTPUTS, NetworkSpec
from granpinn.scales import Scales

TERMS = ("velocity", "surface", "momentum", "continuity", "constitutive")


@dataclass(frozen=True)
class Problem:
    """The network and the constants of the residuals, as granpinn.ops takes them.

    Attributes:
        spec: widths, input map and form of the network.
        physics: [d, g_x, g_y, eta_min, eta_max, U_out, P_out, p_floor].
        term_weights: 1/sigma^2 of the five `TERMS`.
    """

    spec: NetworkSpec
    physics: list[float]
    term_weights: list[float]


def build(flow: Flow, scales: Scales, data: TrainingSet, config: Config) -> Problem:
    """The problem that `config` poses on the data of a flow."""
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
    material = scales.material(flow)
    physics = [
        material.grain_diameter,
        *material.gravity,
        material.eta_min or 0.0,
        math.inf if material.eta_max is None else material.eta_max,
        U_out,
        P_out,
        config.rheology.p_floor,
    ]
    widths = (3, *config.network.widths, OUTPUTS[config.form])
    spec = NetworkSpec(widths, tuple(shift), tuple(scale), config.form)
    return Problem(spec, physics, _term_weights(config, flow, scales))


def _term_weights(config: Config, flow: Flow, scales: Scales) -> list[float]:
    """1/sigma^2 of every term, dimensionless.

    Sigmas in units of the file are taken as they are; the others have the measurement error of
    the velocity added in quadrature.
    """
    sigmas = [getattr(config.weights, f"sigma_{name}") for name in TERMS]
    if config.weights.units == "file":
        force = scales.pressure / scales.length
        units = (scales.velocity, scales.pressure, force, 1 / scales.time, 1 / scales.time)
        sigmas = [sigma / unit for sigma, unit in zip(sigmas, units, strict=True)]
    else:
        measured = scales.to_dimensionless(_measurement_error(flow), "velocity")
        sigmas[0] = math.hypot(sigmas[0], measured)
    return [sigma**-2 for sigma in sigmas]


def _measurement_error(flow: Flow) -> float:
    """Standard deviation of the velocity in the units of the file, 0 where none is given.

    Where it varies from point to point, the one whose inverse square is the mean over the points:
    TrainingSet.point_weights are relative to it.
    """
    variances = []
    for sigma in (flow.sigma_u, flow.sigma_v):
        if isinstance(sigma, np.ndarray):
            inverse = 1 / np.square(sigma[flow.valid], dtype=np.float64)
            variances.append(1 / float(inverse.mean()))
        elif sigma is not None:
            variances.append(sigma**2)
    return math.sqrt(sum(variances) / len(variances)) if variances else 0.0
