r"""Which friction law do data support?  Every law is fitted to a free curve with its error.

**Fit.** Each law takes the parameters $\theta$ that are nearest to the free curve $m$ at N
inertial numbers, evenly in log I over the range of the data,

$$ \chi^2 = (\mu(\theta) - m)^T C^{-1} (\mu(\theta) - m) + \text{prior of } I_0, $$

with the covariance C of the curve. $I_0$ is free here, with a prior of 40 % around its usual
value: the range of I of one flow rarely tells it.

**Told apart.** Two laws are told apart where their curves differ by more than 95 % of the errors of
the free curve, and their $\chi^2$ by more than `CLEAR`. Of the laws that are
not told apart from the nearest one, that with the fewest parameters is chosen.

**Cohesion** is no part of a curve mu(I). It comes from a training of its own, with its error from
the same sums; the law `cohesive` is told from the others where c is significant. Then the free
curve, which has no cohesion, means nothing, and no other law is left.

**The free curve.** Its coefficients c come from a training. Their covariance is

$$ C = V + D, \qquad V = H^{-1} \Big( \sum_B s_B s_B^T \Big) H^{-1}: $$

V holds the residuals, with the scores s_B of boxes in space and time that count as independent (the
sandwich of White, Econometrica 48, 1980). Boxes of several sizes are tried; the largest V counts. D
is the further error of simulated flows with known laws, that of mu(I) at both ends of the range of
I times a factor, and the departure of real grains (error_model.py); between the ends the error of
log mu is linear in log I.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy  # loads scipy.optimize at its first use

from granpinn.arrays import Float64
from granpinn.physics.laws import LAWS, FrictionLaw, LawParameter, cohesive, free, mu_of_i
from granpinn.results.parameters import Parameter, Parameters
from granpinn.results.records import ComparedLaw
from granpinn.results.result import NORMAL_90
from granpinn.training.information import BOXES, Information

N = free.COEFFICIENTS
SHAPES = ((4, 4, 8), (2, 2, 4), (4, 4, 4), (8, 8, 8))  # boxes along x, y and t


class Quadratic(NamedTuple):
    """The least loss of a law: its L free parameters, and their covariance V [L, L]."""

    center: Float64
    covariance: Float64


def quadratic(found: Information, L: int) -> Quadratic | None:
    """The least loss in the first L free parameters; None where the data do not determine them.

    The trained parameters are taken as the least: one more step of Gauss and Newton from there
    would follow the noise of the training.
    """
    scores = found.scores[:, :L].cpu().numpy()
    information = found.information[:, :L, :L].cpu().numpy()
    center = found.free[:L].cpu().numpy()
    H = information.sum(0) + found.prior[:L, :L].cpu().numpy()
    H += 1e-12 * np.trace(H) * np.eye(L)
    if not (np.isfinite(H).all() and np.isfinite(scores).all() and np.linalg.eigvalsh(H)[0] > 0):
        return None
    scores = scores - information @ np.linalg.solve(H, scores.sum(0))
    covariance, largest = np.zeros((L, L)), 0.0
    for shape in SHAPES:
        influence = np.linalg.solve(H, joined(scores, shape).T)
        V = influence @ influence.T
        size = float(np.trace(H @ V))
        if size > largest:
            covariance, largest = V, size
    return Quadratic(center, covariance) if largest > 0 else None


def joined(values: Float64, shape: tuple[int, int, int]) -> Float64:
    """Sums [B, L] over larger boxes, of the values of all boxes [BOXES^3, L]."""
    a, b, c = (BOXES // n for n in shape)
    cube = values.reshape(shape[0], a, shape[1], b, shape[2], c, -1)
    return np.asarray(cube.sum((1, 3, 5)).reshape(np.prod(shape), -1))


def basis(I: Float64, I_low: float, I_high: float) -> Float64:
    """mu of each coefficient at every I [n, N]."""
    columns = [free.friction(I, *row, I_low, I_high) for row in np.eye(N)]
    return np.stack(columns, axis=1)


def model_covariance(
    I: Float64,
    mu: Float64,
    I_range: tuple[float, float],
    of_ends: Float64,
) -> Float64:
    """D at every I [n, n], beyond the residuals.

    Args:
        mu: friction there [n].
        I_range: of the flow, 5th and 95th percentile.
        of_ends: covariance of log mu at both ends of that range [2, 2].
    """
    low, high = np.log(I_range)
    part = np.clip((np.log(I) - low) / (high - low), 0, 1)
    J = mu[:, None] * np.stack([1 - part, part], axis=1)
    return np.asarray(J @ of_ends @ J.T)


CLEAR = 4.0  # difference of chi^2: two standard deviations
I0_SPREAD = 0.4  # of ln I0
KNOWN = 0.5  # of the spread of its prior: a parameter that the data tell less is not determined
LEAST = 0.02  # of the largest friction: where the search begins at least
REACH = 3.0  # of ln theta, around the start
SINGULAR = 1e-12  # of the largest variance: no direction is known better
RULED_OUT = 3.0  # standard deviations of a cohesion that is not 0


@dataclass(frozen=True)
class CurveBand:
    """The free curve over the range of I of a flow.

    Attributes:
        I, mu: inertial numbers and friction [n].
        half: half-width of the band that holds 90 % [n].
        farthest: the same for 95 % [n].
    """

    I: Float64
    mu: Float64
    half: Float64
    farthest: Float64


@dataclass(frozen=True)
class Fit:
    """A law near the free curve.

    Attributes:
        theta: all parameters.
        std: standard deviations of ln theta of the free ones, by name; none of a free curve.
        mu: its curve at the I of the band.
        chi2: distance from the free curve.
    """

    law: FrictionLaw
    theta: tuple[float, ...]
    std: dict[str, float]
    mu: Float64
    chi2: float

    @property
    def unknowns(self) -> int:
        return len(self.law.free)


class Fitter:
    """Fits of one law to free curves.

    Args:
        fixed: values of fixed parameters, by name.
        I: N inertial numbers at which the curves are compared [N].
        root: R of C^-1 = R^T R [N, N].
    """

    def __init__(
        self, law: FrictionLaw, fixed: dict[str, float], I: Float64, root: Float64
    ) -> None:
        scale = law.inertial_scale
        self.law, self.I, self.root, self.fixed = law, I, root, fixed
        self.names = [p.name for p in law.parameters if not p.fixed or p.name == scale]
        self.prior = {scale: I0_SPREAD} if scale else {}

    def theta(self, z: Float64) -> list[float]:
        """All parameters at logarithms z of the unknown ones."""
        values = dict(zip(self.names, np.exp(z).tolist(), strict=True))
        theta: list[float] = []
        for p in self.law.parameters:
            value = values.get(p.name, self.fixed.get(p.name, p.start))
            theta.append(theta[-1] + value if p.variable == "log_above" else value)
        return theta

    def curve(self, z: Float64, I: Float64) -> Float64:
        return np.broadcast_to(self.law.friction(I, *self.theta(z)), I.shape)

    def fit(self, m: Float64) -> tuple[Float64, Float64, float]:
        """z, its covariance, and chi^2, for a free curve m [N]."""
        usual = np.log([self._usual(name, m) for name in self.names])

        def residuals(z: Float64) -> Float64:
            priors = [
                (z[k] - usual[k]) / self.prior[name]
                for k, name in enumerate(self.names)
                if name in self.prior
            ]
            return np.append(self.root @ (self.curve(z, self.I) - m), priors)

        own = np.log([self.law.parameter(name).bounds for name in self.names])
        bounds = np.minimum(usual - REACH, own[:, 0]), np.maximum(usual + REACH, own[:, 1])
        found = scipy.optimize.least_squares(residuals, np.clip(usual, *bounds), bounds=bounds)
        normal = found.jac.T @ found.jac
        # a direction that no data determine is as uncertain as the reach of the search
        covariance = np.linalg.inv(normal + REACH**-2 * np.eye(len(normal)))
        return found.x, covariance, 2 * float(found.cost)

    def _usual(self, name: str, m: Float64) -> float:
        """The start of a parameter: of a coefficient of friction, from the free curve."""
        p = self.law.parameter(name)
        least = LEAST * np.abs(m).max()  # a curve of few data may fall below 0
        if p.name == self.law.names[0]:
            return float(max(m.min(), least))
        if p.variable == "log_above":
            return float(max(np.ptp(m), least))
        return self.fixed.get(name, p.start)


def fits(
    curve: Quadratic,
    ends: tuple[float, float],
    band: CurveBand,
    covariance: Float64,
    fixed: dict[str, dict[str, float]],
) -> list[Fit]:
    """The free curve itself, and every law without cohesion that is nearest to it.

    Args:
        ends: I_low and I_high of the free curve.
        covariance: C of the free curve at `knots` [N, N].
        fixed: values of fixed parameters of every law.
    """
    I = knots((band.I[0], band.I[-1]))
    B = basis(I, *ends)
    variances, directions = np.linalg.eigh(covariance)
    root = (directions / np.sqrt(np.maximum(variances, SINGULAR * variances[-1]))).T
    made = [Fit(free.LAW, (*curve.center.tolist(), *ends), {}, band.mu, 0.0)]
    for law in LAWS.values():
        if law.curve or law.cohesion or not law.compiled:
            continue
        fitter = Fitter(law, fixed.get(law.name, {}), I, root)
        z, spread, chi2 = fitter.fit(B @ curve.center)
        std = dict(zip(fitter.names, np.sqrt(np.diag(spread)).tolist(), strict=True))
        theta = tuple(fitter.theta(z))
        made.append(Fit(law, theta, std, fitter.curve(z, band.I), chi2))
    return made


def knots(I_range: tuple[float, float]) -> Float64:
    """The N inertial numbers at which fits are made."""
    return np.geomspace(*I_range, N)


def apart(a: Fit, b: Fit, band: CurveBand) -> bool:
    """Whether two laws are told apart."""
    return _differ(a, b, band) and abs(a.chi2 - b.chi2) > CLEAR


def _differ(a: Fit, b: Fit, band: CurveBand) -> bool:
    return bool((np.abs(a.mu - b.mu) > band.farthest).any())


def choice(found: Sequence[Fit], band: CurveBand) -> tuple[tuple[ComparedLaw, ...], str]:
    """The records of all laws, with the chosen one first, and its name."""
    named = [fit for fit in found if fit.law is not free.LAW]
    curve = next(fit for fit in found if fit.law is free.LAW)
    best = min(named, key=lambda fit: fit.chi2)
    if _differ(best, curve, band):
        best = curve  # no named law is near the free curve
    alike = [fit for fit in found if fit is best or not apart(fit, best, band)]
    chosen = min(alike, key=lambda fit: fit.unknowns)
    records = [
        ComparedLaw(
            fit.law.name,
            parameters(fit),
            tuple(o.law.name for o in found if o is not fit and not apart(o, fit, band)),
        )
        for fit in sorted(found, key=lambda fit: fit is not chosen)
    ]
    return tuple(records), chosen.law.name


@dataclass(frozen=True)
class Cohesion:
    """What a training with cohesion found.

    Attributes:
        values: all parameters.
        c: the cohesion, in the unit of the pressure of the file.
        least: its standard deviation if there is none.
        std: its standard deviation.
    """

    values: Parameters
    c: float
    least: float
    std: float

    @property
    def sure(self) -> bool:
        """Whether there is cohesion."""
        return self.c > RULED_OUT * self.least

    @property
    def parameters(self) -> Parameters:
        """The parameters with the error of c; `NOT_DETERMINED` where it may be 0."""
        reach = NORMAL_90 * self.std
        own = (
            Parameter(self.c, False, self.std, (max(0.0, self.c - reach), self.c + reach))
            if self.sure
            else Parameter(self.c, False, determined=False)
        )
        return Parameters({**dict(self.values.items()), cohesive.LAW.cohesion or "c": own})


def with_cohesion(
    records: Sequence[ComparedLaw], chosen: str, found: Cohesion
) -> tuple[tuple[ComparedLaw, ...], str]:
    """The records with the law `cohesive`, and the chosen law."""
    own = cohesive.LAW.name
    if found.sure:
        return (ComparedLaw(own, found.parameters), *records), own
    base = next(r for r in records if r.law == mu_of_i.LAW.name)
    alike = (base.law, *base.not_told_apart_from)
    made = [
        replace(r, not_told_apart_from=(*r.not_told_apart_from, own)) if r.law in alike else r
        for r in records
    ]
    return (*made, ComparedLaw(own, found.parameters, alike)), chosen


def parameters(fit: Fit) -> Parameters:
    """The values of a fit with their errors."""
    return Parameters(
        (p.name, _parameter(p, value, fit.std.get(p.name), fit))
        for p, value in zip(fit.law.parameters, fit.theta, strict=True)
    )


def _parameter(p: LawParameter, value: float, std: float | None, fit: Fit) -> Parameter:
    if std is None:
        return Parameter(value, fixed=p.fixed)
    spread = I0_SPREAD if p.name == fit.law.inertial_scale else REACH
    if std > KNOWN * spread:
        return Parameter(value, fixed=False, determined=False)
    if p.variable == "log_above":  # the unknown is the distance from the parameter before it
        std *= 1 - fit.theta[fit.law.names.index(p.name) - 1] / value
    ends = value * math.exp(-NORMAL_90 * std), value * math.exp(NORMAL_90 * std)
    return Parameter(value, fixed=False, std=value * std, interval_90=ends)
