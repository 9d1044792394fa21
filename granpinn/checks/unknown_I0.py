r"""mu_s and the slope (mu_2 - mu_s)/I0 of mu(I) where I0 is not known, and I0 from the flow.

Where I << I0 the law is mu_s + (mu_2 - mu_s) I/I0. The data then determine the slope
(mu_2 - mu_s)/I0 alone: mu_2 and I0 can grow together, and neither has a value of its own. Data over
a wide range of I determine I0, too, by the curvature of mu(I).

What the data say is log mu at n inertial numbers, y of covariance C. For simulated flows it is the
law with I0 free at three of them. How real grains depart from the curvature of
mu(I) is not known; for them it is the law of the run at both ends of the range of I. For every I0

$$ \chi^2(I_0) = \min_{\mu_s, \mu_2}\, (y - \log\mu)^T C^{-1} (y - \log\mu), $$

where log mu is linear in its values at both ends around the best ones. All I0 from a quarter to
four times that of the run are as likely as $\exp(-\chi^2/2)$ says, evenly in log I0. With two
points chi-square is 0, and all count alike. The intervals are the central 90 % of the mixture of
these laws. That of mu_s is lognormal, that of the slope normal.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import scipy

from granpinn.arrays import Float64
from granpinn.errors import CannotGoOn
from granpinn.fit.context import Context
from granpinn.fit.free_curve import LEAST
from granpinn.physics.laws import DEFAULT
from granpinn.results import Parameter, Parameters, Result
from granpinn.results.parameters import NOT_DETERMINED
from granpinn.results.record import Check, Record
from granpinn.results.records import LawPoints
from granpinn.results.result import NORMAL_90
from granpinn.training.information import information
from granpinn.training.last_layer import last_layer
from granpinn.training.loop import TrainingLoop
from granpinn.uncertainty.curve_error import between, quadratic
from granpinn.uncertainty.determined import LARGEST
from granpinn.uncertainty.error_model import Pair, ends_of, line

REACH, VALUES = 4.0, 241  # of I0 over that of the run, upwards and downwards; number of values
STEPS = 4  # of Gauss and Newton with a given I0
TAIL = 0.05  # of a mixture, at either side of its 90 % interval
# Errors over the standard deviations that the residuals show (bench/studies/one_law/note.md).
SCATTER = 4.0
FARTHEST = 40.0  # standard deviations beyond all parts of a mixture


@dataclass(frozen=True)
class UnknownI0(Record):
    """
    Attributes:
        I0: the least and the largest one that counts as possible.
        parameters: mu_s, the slope and, if the flow determines it, I0, with 90 % intervals.
        points: the law with I0 free; None: of real grains.
    """

    title = "I0 unknown"
    notes = (
        "The law of every I0 from a quarter to four times that of the run, fitted to the friction "
        "at the ends of the range of I and, in simulated flows, between. Each counts by how well "
        "it fits. One collapse rarely determines I0; a steep chute that is filmed from rest, or "
        "several flows with one law, may."
    )

    I0: tuple[float, float]
    parameters: Parameters
    points: LawPoints | None = None

    @property
    def words(self) -> str:
        found = ", ".join(f"{name} {p.words}" for name, p in self.parameters.items())
        lost = "" if "I0" in self.parameters else f"; I0 is {NOT_DETERMINED}"
        low, high = self.I0
        return f"with any I0 from {low:.3g} to {high:.3g} (90 % intervals): {found}{lost}"


def make(context: Context) -> UnknownI0 | None:
    result = context.result
    if result.law.name != DEFAULT.name:
        return None
    errors_of(result)
    points, I_range = None, result.law.I_range
    if context.case.flow.of_solver and I_range is not None:
        points = law_points(context.run, context.place, I_range)
    return unknown_I0(result, points)


def law_points(run: TrainingLoop, place: int, I_range: Pair) -> LawPoints | None:
    """The law of a member of a run with I0 free; None: the data do not determine it.

    The last layer and the law are solved once more, with I0 as a third unknown. The law then has
    the slope and the curvature that the data want.

    Args:
        I_range: of the data, 5th and 95th percentile.
    """
    ended = run.trainer.ended(place)
    if ended is None or I_range[0] == I_range[1]:
        return None
    member, params, theta, step = ended
    law = DEFAULT.with_free({"I0": float(theta[DEFAULT.names.index("I0")])})
    member = dataclasses.replace(member, law=law)
    params, theta = last_layer(member, params, theta, step)
    found = information(member, params, theta, step)
    known = None if found is None else quadratic(found, len(law.free))
    if known is None:
        return None
    I, values = np.geomspace(*I_range, 3), theta.double().cpu().numpy()
    mu = law.friction(I, *values)
    slopes = law.by_parameters(I, values) / mu[:, None]
    C = SCATTER**2 * slopes @ known.covariance @ slopes.T + LEAST**2 * np.eye(len(I))
    return LawPoints(tuple(I.tolist()), tuple(np.log(mu).tolist()), tuple(map(tuple, C.tolist())))


def errors_of(result: Result) -> tuple[Float64, Pair]:
    """Covariance of mu_s and mu_2 as of normal errors [2, 2], and the range of I.

    Raises:
        CannotGoOn: the run has no error bars, or its I0 was identified.
    """
    law, I_range, bars = result.covariance, result.law.I_range, result.error_bars
    if law is None or I_range is None or bars is None:
        raise CannotGoOn(f"the run has no error bars: {result.law.reason or 'none were estimated'}")
    if law.names != ("mu_s", "mu_2"):
        raise CannotGoOn("I0 was identified with the law: take its own interval")
    return np.array(law.matrix) * (bars.half_width / NORMAL_90) ** 2, I_range


def unknown_I0(result: Result, points: LawPoints | None = None) -> UnknownI0:
    """mu_s and the slope of a run if its I0 is not known.

    Raises:
        CannotGoOn: as `errors_of`.
    """
    of_law, I_range = errors_of(result)
    mu_s, mu_2, I0 = result.theta
    x = ends_of(I_range, I0)
    mu = line(x) @ np.array([mu_s, mu_2])
    J = line(x) / mu[:, None]
    I, y, C = I0 * np.divide(x, 1 - np.array(x)), np.log(mu), J @ of_law @ J.T
    if points is not None:
        I, y, J = np.array(points.I), np.array(points.log_mu), between(points.I, I_range)
        C = J @ C @ J.T + np.array(points.covariance)
    return dataclasses.replace(of_points(I, y, C, I0), points=points)


def of_points(I: Float64, y: Float64, C: Float64, I0: float) -> UnknownI0:
    """mu_s and the slope, and I0 if it is determined, of the laws through n points.

    Args:
        I, y, C: inertial numbers, log mu there [n] and its covariance [n, n], of normal errors.
        I0: in the middle of those that count.
    """
    white = np.linalg.inv(np.linalg.cholesky(C))
    laws, sd, chi_square, every = [], [], [], []
    for value in (I0 * np.geomspace(1 / REACH, REACH, VALUES)).tolist():
        x = I / (I + value)
        part = (x - x[0]) / (x[-1] - x[0])
        by_ends = np.stack([1 - part, part], axis=1)
        ends = y[[0, -1]]  # log mu there
        for _ in range(STEPS):
            mu = by_ends @ np.exp(ends)
            slopes = white @ (by_ends * np.exp(ends) / mu[:, None])
            ends = ends + np.linalg.lstsq(slopes, white @ (y - np.log(mu)), rcond=None)[0]
        of_law = np.linalg.inv(line((x[0], x[-1])))
        slope_of = np.array([[1.0, 0.0], [-1 / value, 1 / value]]) @ of_law * np.exp(ends)
        law = slope_of.sum(axis=1)
        if law[0] > 0:  # grains have friction
            laws.append(law)
            sd.append(np.linalg.norm(slope_of @ np.linalg.pinv(slopes), axis=1))
            rest = white @ (y - np.log(by_ends @ np.exp(ends)))
            chi_square.append(float(rest @ rest))
            every.append(value)
    weights = np.exp((np.min(chi_square) - np.array(chi_square)) / 2)
    weights /= weights.sum()
    (mu_s, slope), (of_mu_s, of_slope) = np.array(laws).T, np.array(sd).T
    found = {
        "mu_s": mixture(np.log(mu_s), of_mu_s / mu_s, weights, logarithmic=True),
        "slope": mixture(slope, of_slope, weights),
    }
    step = math.log(every[1] / every[0])
    own = mixture(np.log(every), np.full(len(every), step / 2), weights, logarithmic=True)
    assert own.std is not None
    at_ends = max(weights[0], weights[-1]) / weights.max()
    if own.std < LARGEST["I0"] * own.value and at_ends < TAIL:
        found["I0"] = own
    return UnknownI0((every[0], every[-1]), Parameters(found))


def mixture(mean: Float64, sd: Float64, weights: Float64, logarithmic: bool = False) -> Parameter:
    """Median, standard deviation and central 90 % of a mixture of n normal distributions."""

    def quantile(q: float) -> float:
        reach = FARTHEST * float(sd.max())
        ends = float(mean.min()) - reach, float(mean.max()) + reach
        return float(
            scipy.optimize.brentq(
                lambda x: float(weights @ scipy.special.ndtr((x - mean) / sd)) - q, *ends
            )
        )

    middle, low, high = (quantile(q) for q in (0.5, TAIL, 1 - TAIL))
    std = math.sqrt(float(weights @ (sd**2 + mean**2) - (weights @ mean) ** 2))
    if logarithmic:
        middle, low, high = (math.exp(x) for x in (middle, low, high))
        std *= middle
    return Parameter(middle, False, std, (low, high))


# Behind the momentum balance, which takes the error bars from a flow that walls carry.
CHECK = Check("unknown_I0", UnknownI0, make, seconds=10.0, flag="free_I0", quick=False)
