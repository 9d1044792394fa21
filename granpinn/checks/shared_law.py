r"""Do several flows have one friction law? Each is trained by itself, too.

The law of flow f by itself gives log mu at both ends of its range of I. With all of them y [2 F],
their errors of covariance C, and one law $\theta$ of L parameters that fits them best,

$$ \chi^2 = \min_\theta\, (y - \log\mu(\theta))^T C^{-1} (y - \log\mu(\theta)). $$

C has every part of the error bars: method, grains, whose level is in part common to all flows
(uncertainty/error_model.py), assumptions, and the scatter over seeds. p is the share of draws from
these errors with a larger chi-square. So a p below 0.01 is a false alarm in 1 % of all groups, as
far as the error model is right.

The law that fits best weighs every flow by its errors, the training of one law by its residuals.
Of grains it was the better one (bench/studies/one_law).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from granpinn.arrays import Float64
from granpinn.errors import CannotGoOn
from granpinn.fit.case import Case
from granpinn.fit.context import Context, values_alone
from granpinn.fit.one_law import known_of
from granpinn.physics.laws import DEFAULT, FrictionLaw
from granpinn.physics.rheology import by_parameters
from granpinn.results import Result
from granpinn.results.record import CARE, GOOD, Check, Reason, Record, Table
from granpinn.results.result import friction_sd
from granpinn.uncertainty.error_bars import scatter
from granpinn.uncertainty.error_model import Known, load
from granpinn.uncertainty.sensitivity import covariance

DIFFERENT = 0.01  # a smaller p-value needs care
DRAWS, SEED = 20_000, 0
STEPS, LONGEST = 20, 0.5  # of the fit of one law, in the logarithms of its parameters


@dataclass(frozen=True)
class LawApart:
    """The law of one flow that was trained by itself, over its range of I.

    Attributes:
        I: both ends of the range.
        mu, sd: friction there and its standard deviation.
        mu_joint: friction of the law of all flows there.
        mu_best: friction of the law that fits the single laws best.
    """

    name: str
    I: tuple[float, float]
    mu: tuple[float, float]
    sd: tuple[float, float]
    mu_joint: tuple[float, float]
    mu_best: tuple[float, float]


@dataclass(frozen=True)
class SharedLaw(Record):
    """
    Attributes:
        flows: each by itself.
        theta: parameters of the law that fits the laws of the single flows best.
        chi_square, freedom: of the laws of the single flows around it.
        p_value: the probability of a larger chi-square if all flows have one law.
        outside: in what the single fits are beyond the error model, in words.
    """

    title = "Do the flows have one law?"
    notes = (
        "Each flow was trained by itself, too. Chi-square: the scatter of these laws around one "
        "law, over their errors, of which a part is common to all flows. p is the share of draws "
        "from these errors that scatter more. Flows of one law have p < 0.01 in 1 % of all groups, "
        "as far as the error model is right."
    )

    flows: tuple[LawApart, ...]
    theta: tuple[float, ...]
    chi_square: float
    freedom: int
    p_value: float
    outside: tuple[str, ...] = ()

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
            (flow.name, f"{I:.2g}", f"{mu:.3f} ± {sd:.3f}", f"{joint:.3f}", f"{best:.3f}")
            for flow in self.flows
            for I, mu, sd, joint, best in zip(
                flow.I, flow.mu, flow.sd, flow.mu_joint, flow.mu_best, strict=True
            )
        ]
        head = ("flow", "I", "mu by itself", "mu of one law", "mu of the best fit to all")
        return Table(head, rows)

    def reasons(self, result: Result) -> list[Reason]:
        words = f"{self.words[0].upper()}{self.words[1:]}."
        if self.outside and self.different:
            words += f" These errors are extrapolated: {', '.join(self.outside)}."
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
        I0=context.result.parameters["I0"].value,
    )
    flows = [one.flow for one in context.flows]
    apart = context.identify_many(flows, config, keep_fields=False)
    return compared(apart, [one.case for one in context.flows], context.result)


def compared(apart: Sequence[Result], cases: Sequence[Case], joint: Result) -> SharedLaw:
    """The laws of single flows against one law of all; CannotGoOn where one has no error bars."""
    if joint.law.name != DEFAULT.name:
        raise CannotGoOn(f"there are error bars for {DEFAULT.title} only")
    flows, own, ranges = [], [], []
    for result, case, flow in zip(apart, cases, joint.flows, strict=True):
        if result.covariance is None or result.error_bars is None or result.members is None:
            raise CannotGoOn(f"{flow.input.name} has no error bars by itself: {result.law.reason}")
        known = known_of(result, case)
        of_run = covariance(result.assumptions, DEFAULT.free)
        of_run += scatter(result.members, DEFAULT.free)
        flows.append(known)
        own.append(known.slopes @ of_run @ known.slopes.T)
        assert result.law.I_range is not None
        ranges.append(np.array(result.law.I_range))
    law = joint.friction_law
    best = best_fit(flows, own, np.concatenate(ranges), law, joint.theta)
    laws = []
    for result, flow, known, I in zip(apart, joint.flows, flows, ranges, strict=True):
        assert result.covariance is not None
        sd = friction_sd(I, result, result.covariance)
        mu = (known.ends, sd, law.friction(I, *joint.theta), law.friction(I, *best.theta))
        pairs = ((float(low), float(high)) for low, high in (I, *mu))
        laws.append(LawApart(flow.input.name, *pairs))
    words = tuple(dict.fromkeys(words for known in flows for words in load().outside(known)))
    return SharedLaw(tuple(laws), *best, words)


class BestFit(NamedTuple):
    """The law that fits the laws of single flows best, and their scatter around it.

    Attributes:
        theta: parameters of the law.
        p_value: the share of draws from the errors with a larger chi-square.
    """

    theta: tuple[float, ...]
    chi_square: float
    freedom: int
    p_value: float


def best_fit(
    flows: Sequence[Known],
    own: Sequence[Float64],
    I: Float64,
    law: FrictionLaw,
    theta: Sequence[float],
) -> BestFit:
    """The law that fits the laws of F flows best.

    Args:
        own: covariance of log mu at both ends that the error model does not hold, F times [2, 2].
        I: both ends of all flows [2 F].
        law, theta: the law of all; its free parameters are fitted, from these values on.
    """
    model = load()
    C = sum(model.of_flows(flows)) + block_diag(*own)
    white = np.linalg.inv(np.linalg.cholesky(C))
    y, log_theta = np.log(np.concatenate([known.ends for known in flows])), np.log(theta)
    free = [law.names.index(name) for name in law.free]
    for _ in range(STEPS):
        mu = law.friction(I, *np.exp(log_theta))
        slopes = by_parameters(law, I, np.exp(log_theta)) * np.exp(log_theta) / mu[:, None]
        rest = white @ (y - np.log(mu))
        basis, triangle = np.linalg.qr(white @ slopes[:, free])
        step = np.linalg.lstsq(triangle, basis.T @ rest, rcond=None)[0]
        log_theta[free] += np.clip(step, -LONGEST, LONGEST)
    value = float(np.sum((rest - basis @ (basis.T @ rest)) ** 2))
    rng, n = np.random.default_rng(SEED), len(y)
    scale = np.sqrt(model.freedom / rng.chisquare(model.freedom, (DRAWS, n // 2)))
    drawn = rng.standard_normal((DRAWS, n)) * np.repeat(scale, 2, axis=1)
    drawn -= (drawn @ basis) @ basis.T
    above = int(np.count_nonzero(np.sum(drawn**2, axis=1) >= value))
    theta = tuple(np.exp(log_theta).tolist())
    return BestFit(theta, value, n - len(free), (1 + above) / (1 + DRAWS))


CHECK = Check("shared_law", SharedLaw, make, seconds=120.0, quick=False, trains=True)
