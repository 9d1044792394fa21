"""Do several flows have one friction law? The laws of the single flows against that of all.

Chi-square and p-value are those of uncertainty/one_law.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granpinn.errors import CannotGoOn
from granpinn.fit.context import Context
from granpinn.results import Result
from granpinn.results.record import CARE, GOOD, Check, Reason, Record, Table
from granpinn.results.result import friction_sd
from granpinn.uncertainty.one_law import OneLaw

DIFFERENT = 0.01  # a smaller p-value needs care


@dataclass(frozen=True)
class LawApart:
    """The law of one flow by itself, over its range of I.

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
        chi_square, freedom: of the laws of the single flows around that of all.
        p_value: the probability of a larger chi-square if all flows have one law.
        I0: whether it was identified or held, and why, in words.
    """

    title = "Do the flows have one law?"
    notes = (
        "The law of all flows fits the laws of the single flows best, each weighed by its errors, "
        "of which a part is common to all flows. Chi-square: the scatter of the single laws around "
        "it, over their errors. p is the share of draws from these errors that scatter more. Flows "
        "of one law have p < 0.01 in 1 % of all groups, as far as the error model is right."
    )

    flows: tuple[LawApart, ...]
    chi_square: float
    freedom: int
    p_value: float
    I0: str

    @property
    def verdict(self) -> str:
        """Whether they have one law, in words."""
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
    def words(self) -> str:
        return f"{self.verdict}\n{self.I0}"

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
        words = f"{self.verdict[0].upper()}{self.verdict[1:]}."
        if self.different and result.error_bars and result.error_bars.outside:
            words += f" These errors are extrapolated: {', '.join(result.error_bars.outside)}."
        return [Reason(CARE if self.different else GOOD, words)]


def compared(results: Sequence[Result], law: OneLaw) -> SharedLaw:
    """The laws of single flows against the law of all."""
    laws = []
    for result in results:
        assert result.law.I_range is not None
        assert result.covariance is not None
        I = np.array(result.law.I_range)
        mu, joint = (
            result.friction_law.friction(I, *theta) for theta in (result.theta, law.fit.theta)
        )
        ends = (I, mu, friction_sd(I, result, result.covariance), joint)
        pairs = ((float(low), float(high)) for low, high in ends)
        laws.append(LawApart(result.input.name, *pairs))
    scatter = law.fit.chi_square, law.fit.freedom, law.fit.p_value
    return SharedLaw(tuple(laws), *scatter, law.I0)


def make(context: Context) -> None:
    """None: one flow has one law. `compared` makes the record of several."""
    if CHECK.asked(context.case.config):
        raise CannotGoOn("expected several flows with one law, got one flow: use --one-law")


CHECK = Check("shared_law", SharedLaw, make, seconds=0.0, flag="one_law", quick=False)
