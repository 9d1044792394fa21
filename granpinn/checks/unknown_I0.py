r"""mu_s and the slope (mu_2 - mu_s)/I0 of mu(I) where I0 is not known.

Where I << I0 the law is mu_s + (mu_2 - mu_s) I/I0. The data then determine the slope
(mu_2 - mu_s)/I0 alone: mu_2 and I0 can grow together, and neither has a value of its own.

Whatever the I0 of the training, the data determine mu at both ends of their range of I. The law of
another I0 is the line in x = I/(I + I0) through the same two ends. J maps (mu_s, mu_2) to mu at
both ends with the I0 of the run, $J_v$ with another one. With the covariance C of the run,

$$ \theta_v = J_v^{-1} J \theta, \qquad C_v = J_v^{-1} (J C J^T) J_v^{-T}. $$

All I0 from a quarter to four times that of the run are equally likely, evenly in log I0. The
intervals are the central 90 % of the mixture of these laws. That of mu_s is lognormal, that of the
slope normal (bench/studies/inertial_number/note.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.optimize at its first use
from scipy.special import ndtr

from granpinn.arrays import Float64
from granpinn.errors import CannotGoOn
from granpinn.fit.context import Context
from granpinn.physics.laws import DEFAULT
from granpinn.results import Parameter, Parameters, Result
from granpinn.results.record import Check, Record
from granpinn.results.result import NORMAL_90
from granpinn.uncertainty.error_model import Pair, ends_of, line

REACH, VALUES = 4.0, 25  # of I0 over that of the run, upwards and downwards; number of values
TAIL = 0.05  # of a mixture, at either side of its 90 % interval
FARTHEST = 40.0  # standard deviations beyond all parts of a mixture


@dataclass(frozen=True)
class UnknownI0(Record):
    """
    Attributes:
        I0: the least and the largest one that counts as possible.
        parameters: mu_s and the slope, with 90 % intervals.
    """

    title = "I0 unknown"
    notes = (
        "The data fix mu at both ends of their range of I, whatever I0 is. The law of every I0 "
        "from a quarter to four times that of the run goes through both ends, and all count alike. "
        "One flow rarely tells I0; several with one law may."
    )

    I0: tuple[float, float]
    parameters: Parameters

    @property
    def words(self) -> str:
        found = ", ".join(f"{name} {p.words}" for name, p in self.parameters.items())
        return f"with any I0 from {self.I0[0]:.3g} to {self.I0[1]:.3g} (90 % intervals): {found}"


def make(context: Context) -> UnknownI0 | None:
    return unknown_I0(context.result) if context.result.law.name == DEFAULT.name else None


def unknown_I0(result: Result) -> UnknownI0:
    """mu_s and the slope of a run if its I0 is not known.

    Raises:
        CannotGoOn: the run has no error bars, or its I0 was identified.
    """
    law, shear, bars = result.covariance, result.determined, result.error_bars
    if law is None or shear is None or shear.I_range is None or bars is None:
        raise CannotGoOn(f"the run has no error bars: {result.law.reason or 'none were estimated'}")
    if law.names != ("mu_s", "mu_2"):
        raise CannotGoOn("I0 was identified with the law: take its own interval")
    mu_s, mu_2, I0 = result.theta
    J = line(ends_of(shear.I_range, I0))
    mu, C = J @ np.array([mu_s, mu_2]), J @ np.array(law.matrix) @ J.T
    return of_ends(shear.I_range, mu, C * (bars.half_width / NORMAL_90) ** 2, I0)


def of_ends(I_range: Pair, mu: Float64, C: Float64, I0: float) -> UnknownI0:
    """mu_s and the slope of laws through mu at both ends of a range of I.

    Args:
        mu, C: there [2] and its covariance [2, 2], of normal errors.
        I0: in the middle of those that count.
    """
    laws, sd, every = [], [], []
    for value in (I0 * np.geomspace(1 / REACH, REACH, VALUES)).tolist():
        of_law = np.linalg.inv(line(ends_of(I_range, value)))
        slope_of = np.array([[1.0, 0.0], [-1 / value, 1 / value]]) @ of_law
        law = slope_of @ mu
        if law[0] > 0:  # grains have friction
            laws.append(law)
            sd.append(np.sqrt(np.diag(slope_of @ C @ slope_of.T)))
            every.append(value)
    (mu_s, slope), (of_mu_s, of_slope) = np.array(laws).T, np.array(sd).T
    found = Parameters(
        mu_s=mixture(np.log(mu_s), of_mu_s / mu_s, logarithmic=True), slope=mixture(slope, of_slope)
    )
    return UnknownI0((every[0], every[-1]), found)


def mixture(mean: Float64, sd: Float64, logarithmic: bool = False) -> Parameter:
    """Median, standard deviation and central 90 % of equal parts of normal distributions [n]."""

    def quantile(q: float) -> float:
        reach = FARTHEST * float(sd.max())
        ends = float(mean.min()) - reach, float(mean.max()) + reach
        return float(
            scipy.optimize.brentq(lambda x: float(ndtr((x - mean) / sd).mean()) - q, *ends)
        )

    middle, low, high = (quantile(q) for q in (0.5, TAIL, 1 - TAIL))
    std = math.sqrt(float((sd**2).mean() + mean.var()))
    if logarithmic:
        middle, low, high = (math.exp(x) for x in (middle, low, high))
        std *= middle
    return Parameter(middle, False, std, (low, high))


# Behind the momentum balance, which takes the error bars from a flow that walls carry.
CHECK = Check("unknown_I0", UnknownI0, make, seconds=1.0, flag="free_I0", quick=False)
