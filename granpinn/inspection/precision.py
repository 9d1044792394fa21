r"""Expected standard deviations of the parameters of a friction law.

Friction acts where the material shears: a change by $\delta\mu$ changes the velocity of a vector by
about $\kappa H_0 \dot\gamma\,\delta\mu$. N independent vectors with noise $\sigma$ then carry the
Fisher information

$$ F_{ij} = \frac{\kappa^2 H_0^2}{\sigma^2} \sum_{n=1}^{N} \min(\dot\gamma_n, \dot\gamma_{max})^2\,
   \partial_i\mu(I_n)\,\partial_j\mu(I_n), $$

which is that of the residual $\dot\gamma\,s - 2\mu D$ with a strain-rate error of
$\sigma / (\kappa H_0)$. With a cohesion c, $\partial_i\mu$ is $\mu\,\partial_i\ln(c + \mu p)$.
$F^{-1}$ bounds the covariance. The cap $\dot\gamma_{max}$ stands for
layers that are thinner than the region in which a change of friction moves the grains.

$\kappa$ and the cap are calibrated on the bounds of a forward model for two column collapses of
mu(I), (mu_s, mu_2) = (0.2, 0.44) and (0.6, 0.84), with noise of 2 and of 20 %. They reproduce its
standard deviations within a factor 1.25. They are not measured for other flows and laws. The error
of a training is larger than the bound (uncertainty/error_model.py).
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import torch
from torch import Tensor

from granpinn.arrays import Float64
from granpinn.physics.law_values import CompleteLaw
from granpinn.physics.rheology import by_parameters

KAPPA = 0.097
LARGEST_RATE = 15.0  # sqrt(|g| / H0)
LARGEST_CONDITION = 1e12


class AssumedLaw(CompleteLaw):
    """The friction law for which the precision is estimated.

    Raises:
        ValueError: as `CompleteLaw`, or a value is at the end of its range; one sentence.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        own = self.friction_law.parameters
        for p, value, before in zip(own, self.theta, (0.0, *self.theta), strict=False):
            least = before if p.variable == "log_above" else 0.0
            if value <= least:
                raise ValueError(f"{p.name} must be larger than {least:g}, got {value:g}")

    @property
    def inertial_scale(self) -> float | None:
        """The inertial number at which the law bends, None if it has none."""
        name = self.friction_law.inertial_scale
        return None if name is None else float(getattr(self, name))


class Precision(SimpleNamespace):
    """Relative standard deviations from random errors, for every parameter of a law by its name.

    Attributes:
        mu_s, ...: bound from noise, with the parameters known that the law has fixed.
        mu_s_free, ..., I0_free: bounds with all parameters unknown, if the data fix all.
        correlation: of the last free and the first fixed parameter (mu_2 and I0) when all are
            unknown; None if the law fixes none, or the data do not fix all.
        independent_vectors: that flow.
    """


def sensitivities(I: Float64, law: AssumedLaw, p: Float64 | None = None) -> Float64:
    """Derivatives of mu(I) with respect to all N parameters of the law: [K, N].

    With a cohesion: of the logarithm of the yield stress, times mu.

    Args:
        p: pressure in the unit of a cohesion [K]; laws without cohesion do not need it.
    """
    if law.friction_law.cohesion is None:
        return by_parameters(law.friction_law, I, law.theta)

    def logarithm(mu: Tensor, theta: Tensor) -> Tensor:
        stress = law.friction_law.cohesion_of(theta) + mu * torch.as_tensor(p)
        found: Tensor = mu.detach() * stress.log()
        return found

    return by_parameters(law.friction_law, I, law.theta, logarithm)


def expected_precision(
    gamma_dot: Float64,
    I: Float64,
    vectors: Float64,
    sigma: float,
    law: AssumedLaw,
    p: Float64 | None = None,
) -> Precision | None:
    """Standard deviations for data of K cells that flow; None if the data do not fix the law.

    Args:
        gamma_dot, I: shear rate and inertial number [K], dimensionless.
        vectors: independent vectors in every cell [K].
        sigma: noise of one component, dimensionless.
        p: as for `sensitivities`.
    """
    J = sensitivities(I, law, p)
    weight = vectors * (KAPPA * np.minimum(gamma_dot, LARGEST_RATE)) ** 2
    information = np.einsum("k,ki,kj->ij", weight, J, J)
    relative = information * np.outer(law.theta, law.theta)  # for logarithms of the parameters
    parameters = law.friction_law.parameters
    fixed = [k for k, p in enumerate(parameters) if p.fixed]
    free = [k for k, p in enumerate(parameters) if not p.fixed]
    of_free = relative[np.ix_(free, free)]
    if not np.linalg.cond(of_free) < LARGEST_CONDITION:
        return None
    sd = sigma * np.sqrt(np.diag(np.linalg.inv(of_free)))
    bounds = dict(zip(law.friction_law.free, map(float, sd), strict=True))
    unknown, correlation = {}, None
    if np.linalg.cond(relative) < LARGEST_CONDITION:
        covariance = np.linalg.inv(relative)
        sd = sigma * np.sqrt(np.diag(covariance))
        unknown = {f"{p.name}_free": float(s) for p, s in zip(parameters, sd, strict=True)}
        if fixed:
            i, j = free[-1], fixed[0]
            correlation = float(covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j]))
    return Precision(
        **bounds,
        **unknown,
        correlation=correlation,
        independent_vectors=float(vectors.sum()),
    )
