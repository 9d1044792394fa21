r"""Expected standard deviations of mu_s, mu_2 and I0: the information in the vectors.

A change of friction by $\delta\mu$ changes the velocity of a vector by about
$\kappa H_0 \dot\gamma\,\delta\mu$: friction acts where the material shears. N independent vectors
with noise $\sigma$ then carry the Fisher information

$$ F_{ij} = \frac{\kappa^2 H_0^2}{\sigma^2} \sum_{n=1}^{N} \min(\dot\gamma_n, \dot\gamma_{max})^2\,
   \partial_i\mu(I_n)\,\partial_j\mu(I_n), $$

which is that of the residual $\dot\gamma\,s - 2\mu D$ with a strain-rate error of
$\sigma / (\kappa H_0)$, and $F^{-1}$ bounds the covariance. The cap $\dot\gamma_{max}$ stands for
layers that are thinner than what a change of friction moves. Both constants are calibrated on the
bounds of a forward model for two column collapses, (mu_s, mu_2) = (0.2, 0.44) and (0.6, 0.84),
whose standard deviations come out within a factor 1.25, with the noise of 2 and of 20 %; for other
flows nothing has measured them. A training stays above the bound and adds a scatter of its own, by
the constants below, which are measured (bench/studies/noise). Systematic errors are not in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granpinn.inspection.view import Float64

KAPPA = 0.097
LARGEST_RATE = 15.0  # sqrt(|g| / H0)
NAMES = ("mu_s", "mu_2", "I0")
# Scatter over seeds of the default training without noise, relative (bench/studies/recipe).
TRAINING_SCATTER = {"mu_s": 0.003, "mu_2": 0.015}
# Its rms error with noise of 20 % over the bound, three materials (bench/studies/noise).
TRAINING_EXCESS = {"mu_s": 1.5, "mu_2": 5.0}
LARGEST_CONDITION = 1e12


@dataclass(frozen=True)
class Law:
    """The friction law that the precision is estimated for."""

    mu_s: float = 0.4
    mu_2: float = 0.64
    I0: float = 0.3


@dataclass(frozen=True)
class Precision:
    """Relative standard deviations from random errors.

    Attributes:
        mu_s, mu_2: with I0 known: the bound from noise.
        mu_s_trained, mu_2_trained: what the default training reaches.
        mu_s_free, mu_2_free, I0_free: with I0 unknown too, bounds.
        correlation: of mu_2 and I0 when both are unknown.
        independent_vectors: that flow.
    """

    mu_s: float
    mu_2: float
    mu_s_trained: float
    mu_2_trained: float
    mu_s_free: float
    mu_2_free: float
    I0_free: float
    correlation: float
    independent_vectors: float


def sensitivities(I: Float64, law: Law) -> Float64:  # noqa: E741
    """Derivatives of mu(I) with respect to mu_s, mu_2 and I0: [K, 3]."""
    phi = I / (I + law.I0)
    slope = -(law.mu_2 - law.mu_s) * phi / (law.I0 + I)
    return np.stack([1 - phi, phi, slope], axis=-1)


def expected_precision(
    gamma_dot: Float64,
    I: Float64,  # noqa: E741
    vectors: Float64,
    sigma: float,
    law: Law,
) -> Precision | None:
    """Standard deviations for data of K cells that flow; None where they do not fix a law.

    Args:
        gamma_dot, I: shear rate and inertial number [K], dimensionless.
        vectors: independent vectors in every cell [K].
        sigma: noise of one component, dimensionless.
    """
    J = sensitivities(I, law)
    weight = vectors * (KAPPA * np.minimum(gamma_dot, LARGEST_RATE)) ** 2
    information = np.einsum("k,ki,kj->ij", weight, J, J)
    size = np.array([law.mu_s, law.mu_2, law.I0])
    relative = information * np.outer(size, size)  # for logarithms of the parameters
    if not np.linalg.cond(relative) < LARGEST_CONDITION:
        return None
    fixed, free = np.linalg.inv(relative[:2, :2]), np.linalg.inv(relative)
    known, all_free = (sigma * np.sqrt(np.diag(c)) for c in (fixed, free))
    trained = [
        math.hypot(TRAINING_EXCESS[name] * bound, TRAINING_SCATTER[name])
        for name, bound in zip(NAMES[:2], known, strict=True)
    ]
    correlation = free[1, 2] / np.sqrt(free[1, 1] * free[2, 2])
    return Precision(
        *map(float, [*known, *trained, *all_free, correlation, vectors.sum()]),
    )
