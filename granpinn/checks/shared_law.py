r"""Do several flows have one friction law? Each is trained by itself, too.

Without a common law the laws of the single flows, $\theta_f$ with covariance $C_f$, scatter by more
than their errors. For one law,

$$ \chi^2 = \sum_f (\theta_f - \bar\theta)^T C_f^{-1} (\theta_f - \bar\theta), \quad
   \bar\theta = \Big(\sum_f C_f^{-1}\Big)^{-1} \sum_f C_f^{-1} \theta_f, $$

has the distribution of chi-square with $2 (F - 1)$ degrees of freedom (Cochran, Biometrics 10,
1954). The errors are those of Student's distribution with $\nu$ degrees of freedom and the scale
$C_f$: the variance is $\nu / (\nu - 2)$ times that.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from granpinn.errors import CannotGoOn
from granpinn.fit.context import Context, values_alone
from granpinn.physics.laws import DEFAULT
from granpinn.results import Result
from granpinn.results.record import CARE, GOOD, Check, Reason, Record, Table
from granpinn.uncertainty.error_bars import NAMES
from granpinn.uncertainty.error_model import ends_of, line

DIFFERENT = 0.01  # a smaller p-value needs care; how often it is a false alarm is not known


@dataclass(frozen=True)
class LawApart:
    """The law of one flow that was trained by itself, over its range of I.

    Attributes:
        I: both ends of the range.
        mu, sd: friction there and its standard deviation.
        mu_joint: friction of the law of all flows there.
    """

    name: str
    I: tuple[float, float]
    mu: tuple[float, float]
    sd: tuple[float, float]
    mu_joint: tuple[float, float]


@dataclass(frozen=True)
class SharedLaw(Record):
    """
    Attributes:
        flows: each by itself.
        chi_square, freedom: of the laws of the single flows around their weighted mean.
        p_value: the probability of a larger chi-square if all flows have one law.
    """

    title = "Do the flows have one law?"
    notes = (
        "Each flow was trained by itself, too. Chi-square: the scatter of these laws around their "
        "weighted mean, over their errors. The errors count as independent between flows. How "
        "often the test is wrong has not been measured: error bars of a flow that are too narrow "
        "look like another law."
    )

    flows: tuple[LawApart, ...]
    chi_square: float
    freedom: int
    p_value: float

    def __post_init__(self) -> None:
        if not (0 <= self.p_value <= 1 and self.chi_square >= 0 and self.freedom > 0):
            raise ValueError(
                "expected p_value in [0, 1], chi_square >= 0 and freedom > 0, got "
                f"{self.p_value}, {self.chi_square} and {self.freedom}"
            )

    @property
    def words(self) -> str:
        said = (
            "the flows differ by more than their errors"
            if self.different
            else "one law explains all flows"
        )
        return (
            f"{said}: chi-square {self.chi_square:.2g} with {self.freedom} degrees of freedom, "
            f"p = {self.p_value:.2g}"
        )

    @property
    def different(self) -> bool:
        return self.p_value < DIFFERENT

    @property
    def table(self) -> Table:
        rows = [
            (flow.name, f"{I:.2g}", f"{mu:.3f} ± {sd:.3f}", f"{joint:.3f}")
            for flow in self.flows
            for I, mu, sd, joint in zip(flow.I, flow.mu, flow.sd, flow.mu_joint, strict=True)
        ]
        return Table(("flow", "I", "mu by itself", "mu of one law"), rows)

    def reasons(self, result: Result) -> list[Reason]:
        words = f"{self.words[0].upper()}{self.words[1:]}."
        return [Reason(CARE if self.different else GOOD, words)]


def make(context: Context) -> SharedLaw | None:
    if not context.flows:
        if CHECK.asked(context.case.config):
            raise CannotGoOn("expected several flows with one law, got one flow: use --one-law")
        return None
    assert context.identify_many is not None
    steps = context.run.trainer.step
    config = dataclasses.replace(
        values_alone(context.case.config),
        checks=CHECK.name,  # not "none", for the effects of assumptions are part of the errors
        steps=steps,
        epochs=None,
        max_time=None,
        resume=False,
    )
    flows = [one.flow for one in context.flows]
    return compared(context.identify_many(flows, config, keep_fields=False), context.result)


def compared(apart: Sequence[Result], joint: Result) -> SharedLaw:
    """The laws of single flows against one law of all; CannotGoOn where one has no error bars."""
    if joint.law.name != DEFAULT.name:
        raise CannotGoOn(f"there are error bars for {DEFAULT.title} only")
    laws, precisions, values = [], [], []
    mu_s, mu_2, I0 = joint.theta
    for result, flow in zip(apart, joint.flows, strict=True):
        I_range, bars = result.law.I_range, result.error_bars
        if result.covariance is None or bars is None or I_range is None:
            raise CannotGoOn(f"{flow.input.name} has no error bars by itself: {result.law.reason}")
        C = bars.freedom / (bars.freedom - 2) * np.array(result.covariance.matrix)
        theta = np.array([result.parameters[name].value for name in NAMES])
        to_ends = line(ends_of(I_range, I0))
        sd = np.sqrt(np.diag(to_ends @ C @ to_ends.T))
        pairs = (I_range, to_ends @ theta, sd, to_ends @ (mu_s, mu_2))
        laws.append(LawApart(flow.input.name, *((float(a), float(b)) for a, b in pairs)))
        precisions.append(np.linalg.inv(C))
        values.append(theta)
    weighted = np.sum([P @ theta for P, theta in zip(precisions, values, strict=True)], axis=0)
    mean = np.linalg.solve(np.sum(precisions, axis=0), weighted)
    parts = [(t - mean) @ P @ (t - mean) for P, t in zip(precisions, values, strict=True)]
    chi_square, freedom = float(np.sum(parts)), len(NAMES) * (len(laws) - 1)
    p_value = float(stats.chi2.sf(chi_square, freedom))
    return SharedLaw(tuple(laws), chi_square, freedom, p_value)


CHECK = Check("shared_law", SharedLaw, make, seconds=120.0, quick=False, trains=True)
