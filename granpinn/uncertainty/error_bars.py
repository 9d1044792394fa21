r"""Error bars of (mu_s, mu_2), and whether the data follow the law at all.

For the center c of an ensemble, with z = (error of mu_s, error of mu_2) / mu_s, the covariance is

$$ C = V + s^2 D, \qquad s = \max(1, m / m_0)\,\max(1, n_0 / n)^{3/2}: $$

V is the scatter of the center over seeds and measurement noise, estimated from the members and,
as there are few of them, from the calibration table; D is what simulated collapses with known
parameters show beyond that (the mean of e e^T, so that a common offset is in it); s lets it grow
where the velocity is resolved worse (error m) than in the study (m_0) and where there are fewer
steps (n) than there (n_0): mu_2 was 12, 19 and 33 % too high after 4,000, 2,800 and 2,000 steps.
m is the misfit beyond the known noise, but no more than the equations' residuals tell of, which
grow with it (`resolution`): what they do not tell of is noise that nobody has stated.

**Scatter without noise.** V = f(K) S: S pools the members' covariance with the table's, as a
covariance with an inverse Wishart prior; f(K) is the variance of a median over that of one value.

**Scatter with noise.** Seeds alone share one draw of the noise, and so do not see what another draw
would give. Half of the members get the known noise once more on top of it. To first order their
shift from the center has the covariance of the sampling error, whether the noise is redrawn on a
fitted field or on the data, and the latter needs no fit to begin with. Their mean square shift has
besides the scatter over seeds, and the bias that as much noise again makes: errors in variables.
V is this mean square, with as many degrees of freedom as members are redrawn, and what V is without
noise. The table does not enter the former: it does not know the noise.

Intervals are those of Student's distribution with the degrees of freedom of C (Welch,
Satterthwaite), times the widening of the table, in log mu: they hold no negative friction.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn.results.records import ErrorBars, Members, Residuals, Verdict
from granpinn.uncertainty.calibration import Calibration

Array = npt.NDArray[np.float64]
Pair = tuple[float, float]

NOISE_ERROR = 1.02  # mean square of noise in the data over the known one, at most
LEAST_RESIDUAL = 0.8  # of data of the law, as a multiple of what the table says
SLOWNESS = 1.5  # power of the steps with which errors fall where they are too few
LONGEST = 10.0  # half an interval, in log mu: beyond that nothing is known anyway


class Estimate(NamedTuple):
    """mu = (mu_s, mu_2), their covariance [2, 2] and 90 % intervals."""

    mu: Pair
    covariance: Array
    intervals: tuple[Pair, Pair]
    bars: ErrorBars

    @property
    def std(self) -> Pair:
        return _pair(np.sqrt(np.diag(self.covariance)))


def center(members: Members) -> Pair:
    """Medians of mu_s and of the slope (mu_2 - mu_s) over the members whose data are as measured.

    The slope and not mu_2, for it is the slope that the data feel; over all members where none of
    those is left. The median of log mu_s or log slope would be the same.
    """
    values = _values(members)
    kept = values[~np.array(members.redrawn)]
    kept = kept if len(kept) else values
    mu_s = float(np.median(kept[:, 0]))
    return mu_s, mu_s + float(np.median(kept[:, 1] - kept[:, 0]))


def nearest(members: Members, calibration: Calibration) -> int:
    """Index of the member that is nearest to the center, measured by the table's scatter."""
    z = _z(members, center(members))
    distance = np.einsum("ki,ij,kj->k", z, np.linalg.inv(calibration.scatter), z)
    distance[np.array(members.redrawn) & ~np.all(members.redrawn)] = np.inf
    return int(np.argmin(distance))


def estimate(
    members: Members, residuals: Residuals, steps: int, calibration: Calibration
) -> Estimate:
    """Center, covariance and intervals of an ensemble of K >= 1 trainings of so many steps."""
    mu = center(members)
    V, freedom = scatter(members, calibration)
    D = discrepancy_scale(residuals, steps, calibration) ** 2 * calibration.discrepancy_at(mu[0])
    C = V + D
    v, d, c = np.diag(V), np.diag(D), np.diag(C)
    n = c**2 / (v**2 / freedom + d**2 / calibration.discrepancy_weight)
    half = np.array([student_95(n_j) for n_j in n]) * np.array(calibration.widening)
    reach = np.minimum(half * np.sqrt(c) * mu[0] / np.array(mu), LONGEST)
    intervals = [(m * math.exp(-r), m * math.exp(r)) for m, r in zip(mu, reach, strict=True)]
    bars = ErrorBars(
        scatter=_pair(mu[0] * np.sqrt(v)),
        discrepancy=_pair(mu[0] * np.sqrt(d)),
        freedom=_pair(n),
        half_width=_pair(half),
        provenance=calibration.provenance,
        provisional=calibration.provisional,
    )
    return Estimate(mu, mu[0] ** 2 * C, (intervals[0], intervals[1]), bars)


def scatter(members: Members, calibration: Calibration) -> tuple[Array, float]:
    """V [2, 2] of z of the center, and its degrees of freedom."""
    z, redrawn = _z(members, center(members)), np.array(members.redrawn)
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


def velocity_error(residuals: Residuals, calibration: Calibration) -> float:
    """Relative error of the fitted velocity: misfit beyond the noise, and what noise leaves."""
    beyond = max(0.0, residuals.velocity**2 - NOISE_ERROR * residuals.noise**2)
    return math.hypot(math.sqrt(beyond), calibration.noise_part * residuals.noise)


def resolution(residuals: Residuals, calibration: Calibration) -> float:
    """Relative error of the fitted velocity, as far as the residuals of the equations show one.

    Noise that was not stated is in the misfit, but a fit that does not follow it keeps small
    residuals. The larger one of the two counts.
    """
    shown = max(
        calibration.momentum.misfit(residuals.momentum / LEAST_RESIDUAL),
        calibration.constitutive.misfit(residuals.constitutive / LEAST_RESIDUAL),
    )
    return min(velocity_error(residuals, calibration), shown)


def discrepancy_scale(residuals: Residuals, steps: int, calibration: Calibration) -> float:
    """s; larger still where the residuals reject the law, by their excess over the limit."""
    resolved = max(1.0, resolution(residuals, calibration) / calibration.misfit)
    trained = math.pow(max(1.0, calibration.steps / max(1, steps)), SLOWNESS)
    ratios = residual_ratios(residuals, calibration)
    limits = (calibration.momentum.limit, calibration.constitutive.limit)
    excess = max(1.0, *(r / limit for r, limit in zip(ratios, limits, strict=True)))
    return resolved * trained * excess


def residual_ratios(residuals: Residuals, calibration: Calibration) -> Pair:
    """Momentum and constitutive residual, as multiples of what data of the law leave."""
    error = max(velocity_error(residuals, calibration), 1e-12)
    return (
        calibration.momentum.ratio(residuals.momentum, error),
        calibration.constitutive.ratio(residuals.constitutive, error),
    )


def verdict(mu: Pair, residuals: Residuals, calibration: Calibration) -> Verdict:
    """Whether the residuals are those of data that follow mu(I), in words.

    Another law can leave small residuals, for the stress is an unknown of the fit; it then shows in
    parameters that no material of the calibration has.
    """
    ratios = residual_ratios(residuals, calibration)
    error = velocity_error(residuals, calibration)
    if error > calibration.largest_misfit:
        why = f"the velocity is resolved to {100 * error:.2g} % only"
        return Verdict(None, f"whether these data follow mu(I) cannot be told: {why}", *ratios)
    limits = (calibration.momentum.limit, calibration.constitutive.limit)
    broken = [
        f"{name} residual {ratio:.1f}x what data of this law leave (limit {limit:.1f}x)"
        for name, ratio, limit in zip(("momentum", "constitutive"), ratios, limits, strict=True)
        if ratio > limit
    ]
    if broken:
        words = f"these data do not follow mu(I): {' and '.join(broken)}"
        return Verdict(False, words, *ratios)
    for name, value, (low, high) in (
        ("mu_s", mu[0], calibration.valid_mu_s),
        ("mu_2/mu_s", mu[1] / mu[0], calibration.valid_ratio),
    ):
        if not low <= value <= high:
            words = (
                f"these data may follow another law: {name} = {value:.3g} lies outside of "
                f"{low:g} to {high:g}, where residuals and error bars were calibrated"
            )
            return Verdict(None, words, *ratios)
    words = (
        f"nothing contradicts mu(I): momentum residual {ratios[0]:.1f}x and constitutive "
        f"{ratios[1]:.1f}x what data of this law leave"
    )
    return Verdict(True, words, *ratios)


def student_95(n: float) -> float:
    """95 % quantile of Student's distribution with n > 0 degrees of freedom.

    Abramowitz & Stegun 26.7.5 from n = 3 on (1 % off there, less above); below, the exact quantiles
    of n = 1 and 2 are joined to it.
    """
    if n < 3:
        known = (6.3138, 2.9200, 2.3534)
        return float(np.interp(1 / n, (1 / 3, 1 / 2, 1), known[::-1]))
    z = NormalDist().inv_cdf(0.95)
    return z + sum(
        term / n**k
        for k, term in enumerate(
            (
                (z**3 + z) / 4,
                (5 * z**5 + 16 * z**3 + 3 * z) / 96,
                (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
            ),
            start=1,
        )
    )


def _values(members: Members) -> Array:
    """(mu_s, mu_2) of the members [K, 2]."""
    return np.stack([members.mu_s, members.mu_2], axis=1)


def _z(members: Members, mu: Pair) -> Array:
    """(mu - center) / mu_s of the members [K, 2]."""
    return np.asarray((_values(members) - np.array(mu)) / mu[0])


def _pair(values: Array) -> Pair:
    return float(values[0]), float(values[1])
