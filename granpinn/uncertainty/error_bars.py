r"""Error bars of (mu_s, mu_2); for mu(I) alone, as they are calibrated by simulated mu(I) flows.

For the center c of an ensemble, with z = (error of mu_s, error of mu_2) / mu_s, the covariance is

$$ C = V + s^2 D_n + N + A, \qquad s = g(m / m_0)\,\max(1, n_0 / n)^{3/2}: $$

V is the scatter of the center over seeds and measurement noise, estimated from the members and, as
they are few, from the calibration table. D_n is the further error of simulated collapses with known
parameters after n steps: the mean of e e^T, which includes a common offset. s enlarges it if the
velocity error m is larger than in the study (m_0), or n is smaller than in the study of the
shortest trainings (n_0). m is the misfit beyond the known noise, capped by the misfit that the
equation residuals imply (`resolution`): the rest of the misfit is noise that the file does not
state. The growth g of the errors with it, 1 below m_0, was measured on films of simulated collapses
(bench/studies/coverage); beyond their misfit it is in proportion. Where the residuals imply all of
the misfit, errors grow faster with it (misfit_growth.py).
D_n is carried over to the inertial numbers that the data hold. N is the measured effect of noise,
most of which is a bias that all members share (held.py). A is the effect of assumptions, such as
the offset of the surface line (of_assumptions.py); their priors are given and do not change the
degrees of freedom.

**Scatter without noise.** V = f(K) S: S pools the members' covariance with the table's, as a
covariance with an inverse Wishart prior; f(K) is the variance of a median over that of one value.

**Scatter with noise.** Seeds alone share one draw of the noise, so their scatter does not contain
the effect of another draw. A second draw of the known noise is added to the data of half of them.
To first order, their shift from the center has the covariance of the sampling error. Their mean
square shift also contains the scatter over seeds and the bias of doubled noise (errors in
variables). V is the V without noise plus this mean square, with as many degrees of freedom as
members are redrawn.
The table does not enter the mean square: its studies have no noise.

Intervals are from Student's distribution with the degrees of freedom of V + s^2 D_n + N (Welch,
Satterthwaite), times the widening of the table. They are symmetric in log mu, so friction stays
positive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from granpinn.arrays import Float64
from granpinn.results import Residuals
from granpinn.results.assumed import Assumed
from granpinn.results.records import ErrorBars, Members
from granpinn.uncertainty.calibration import Calibration
from granpinn.uncertainty.center import center, deviations
from granpinn.uncertainty.held import Held, by_noise, carried
from granpinn.uncertainty.misfit_growth import MisfitGrowth
from granpinn.uncertainty.of_assumptions import covariance
from granpinn.uncertainty.of_law import beyond_noise, excess, velocity_error

Pair = tuple[float, float]
Part = tuple[Float64, float]  # a covariance of z [2, 2] and its degrees of freedom

LEAST_RESIDUAL = 0.8  # of data of the law, as a multiple of the value in the table
SLOWNESS = 1.5  # errors of trainings shorter than any study are proportional to steps^-SLOWNESS
LEAST_MISFIT = 1e-12  # below that of any training
LONGEST = 10.0  # largest half interval, in log mu


class Estimate(NamedTuple):
    """mu = (mu_s, mu_2), their covariance [2, 2] and 90 % intervals."""

    mu: Pair
    covariance: Float64
    intervals: tuple[Pair, Pair]
    bars: ErrorBars

    @property
    def std(self) -> Pair:
        return _pair(np.sqrt(np.diag(self.covariance)))


def estimate(
    members: Members,
    residuals: Residuals,
    steps: int,
    calibration: Calibration,
    assumed: Sequence[Assumed] = (),
    held: Held | None = None,
) -> Estimate:
    """Center, covariance and intervals of an ensemble of K >= 1 trainings of so many steps.

    Args:
        held: what the data hold; None: as the flows of the calibration.
    """
    mu = middle(members)
    parts = scatter(members, calibration), *further(members, residuals, steps, calibration, held)
    return combined(mu, parts, calibration, assumed)


def further(
    members: Members,
    residuals: Residuals,
    steps: int,
    calibration: Calibration,
    held: Held | None = None,
) -> list[Part]:
    """The errors of a center beyond its scatter: the discrepancy, and the effect of noise."""
    mu = middle(members)
    D = discrepancy(mu[0], residuals, steps, calibration)
    if held is not None and calibration.reach is not None:
        structure = _of_structure(residuals, calibration)
        D = carried(D, mu, held.x, calibration.reach, structure)
    parts = [(D, calibration.discrepancy_weight)]
    noise = calibration.noise
    if held is not None and held.noise > 0 and noise is not None:
        parts.append((by_noise(mu, held, noise), noise.flows))
    return parts


def middle(members: Members) -> Pair:
    """(mu_s, mu_2) of the center of an ensemble."""
    return _pair(center(members))


def combined(
    mu: Pair, parts: Sequence[Part], calibration: Calibration, assumed: Sequence[Assumed] = ()
) -> Estimate:
    """The estimate from the scatter of a center, further errors, and what was assumed.

    Args:
        parts: the scatter first.
    """
    A = covariance(assumed, ("mu_s", "mu_2")) / mu[0] ** 2
    C = A + sum(matrix for matrix, _ in parts)
    c = np.diag(C)
    own = [np.diag(matrix) for matrix, _ in parts]
    squares = sum(v**2 / freedom for v, (_, freedom) in zip(own, parts, strict=True))
    n = sum(own) ** 2 / squares
    half = special.stdtrit(n, 0.95) * np.array(calibration.widening)
    reach = np.minimum(half * np.sqrt(c) * mu[0] / np.array(mu), LONGEST)
    intervals = [(m * math.exp(-r), m * math.exp(r)) for m, r in zip(mu, reach, strict=True)]
    bars = ErrorBars(
        scatter=_pair(mu[0] * np.sqrt(own[0])),
        discrepancy=_pair(mu[0] * np.sqrt(sum(own[1:]))),
        assumptions=_pair(mu[0] * np.sqrt(np.diag(A))) if A.any() else None,
        freedom=_pair(n),
        half_width=_pair(half),
        provenance=calibration.provenance,
        provisional=calibration.provisional,
    )
    return Estimate(mu, mu[0] ** 2 * C, (intervals[0], intervals[1]), bars)


def scatter(members: Members, calibration: Calibration) -> tuple[Float64, float]:
    """V [2, 2] of z of the center, and its degrees of freedom."""
    z, redrawn = deviations(members), np.array(members.redrawn)
    kept = z[~redrawn] if not redrawn.all() else z
    deviation = kept - kept.mean(axis=0)
    freedom = calibration.scatter_weight + len(kept) - 1
    pooled = calibration.scatter_weight * np.array(calibration.scatter) + deviation.T @ deviation
    V = median_variance(len(kept)) * pooled / freedom
    if not redrawn.any():
        return V, freedom
    n = float(np.sum(redrawn))
    return V + z[redrawn].T @ z[redrawn] / n, n


def median_variance(K: int) -> float:
    """Variance of the median of K normal values over that of one: pi/2 / (K - 1 + pi/2).

    The asymptotic pi/(2K), shifted so that it is 1 for K = 1; 2 % off for odd K, up to 22 % too
    large for even ones.
    """
    return math.pi / 2 / (K - 1 + math.pi / 2)


def resolution(residuals: Residuals, calibration: Calibration) -> float:
    """Relative error of the fitted velocity: its misfit, or what the residuals imply if less.

    Noise that the file does not state enlarges the misfit. The residuals stay small if the fit
    does not follow this noise. Where the effect of noise has an entry of its own in the table, it
    is not part of this error.
    """
    return _misfit(residuals, calibration) * implied(residuals, calibration)


def implied(residuals: Residuals, calibration: Calibration) -> float:
    """The largest misfit that the residuals of the equations imply, over the misfit; at most 1."""
    shown = max(
        usual.misfit(residuals[name] / LEAST_RESIDUAL)
        for name, usual in calibration.residuals.items()
    )
    return min(1.0, shown / max(_misfit(residuals, calibration), LEAST_MISFIT))


def _misfit(residuals: Residuals, calibration: Calibration) -> float:
    """Relative misfit of the velocity beyond its known noise."""
    if calibration.noise:
        return beyond_noise(residuals)
    return velocity_error(residuals, calibration)


def discrepancy(mu_s: float, residuals: Residuals, steps: int, calibration: Calibration) -> Float64:
    """s^2 D_n [2, 2], times the squared excess of the residuals where they reject the law."""
    s = unresolved(residuals, calibration, calibration.growth)
    s *= slowness(steps, calibration.lengths[0].steps)
    return s**2 * calibration.discrepancy_at(mu_s, steps)


def unresolved(
    residuals: Residuals, calibration: Calibration, growth: MisfitGrowth | None = None
) -> float:
    """The effect g of m / m_0, times the excess of the residuals over their limit.

    Args:
        growth: of errors with the misfit; None: in proportion.
    """
    ratio = _ratio(residuals, calibration)
    effect = ratio if growth is None else growth.factor(ratio)
    return effect * excess(residuals, calibration)


def _ratio(residuals: Residuals, calibration: Calibration) -> float:
    """m / m_0, at least 1."""
    return max(1.0, resolution(residuals, calibration) / calibration.misfit)


def _of_structure(residuals: Residuals, calibration: Calibration) -> float:
    """Factor on the errors at the lower end of the range of I, for structure that a fit misses."""
    if calibration.growth is None:
        return 1.0
    shown = implied(residuals, calibration)
    return calibration.growth.of_structure(_ratio(residuals, calibration), shown)


def slowness(steps: int, studied: int) -> float:
    """Factor on the errors of a training of fewer steps than were studied."""
    return math.pow(max(1.0, studied / max(1, steps)), SLOWNESS)


def _pair(values: npt.ArrayLike) -> Pair:
    first, second = np.asarray(values).tolist()
    return first, second
