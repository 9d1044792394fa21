"""The identified law against the momentum balance, which needs no network."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from granpinn.estimates.confined import undetermined
from granpinn.inspection.momentum_balance import I0, Baseline, Point
from granpinn.results import Parameters, Result
from granpinn.results.record import BAD, CARE, GOOD, Check, Reason, Record
from granpinn.results.result import friction_sd

if TYPE_CHECKING:  # a record is read without torch
    from granpinn.fit.case import Case
    from granpinn.fit.context import Context

SIGNIFICANT = 3.0  # standard errors between the momentum balance and the law
CARRIED = "more than the base carries the grains, and the forces of walls are not known"


@dataclass(frozen=True)
class Difference:
    """The law of the network against one point of the balance.

    Attributes:
        I: of the point.
        percent: 100 (mu of the network / mu of the balance - 1).
        se_percent: of both together: their variances are added, as the balance uses no network.
    """

    I: float
    percent: float
    se_percent: float

    @property
    def standard_errors(self) -> float:
        """The difference in standard errors."""
        return abs(self.percent) / self.se_percent

    def __str__(self) -> str:
        return f"{self.percent:+.1f} +- {self.se_percent:.1f} % at I = {self.I:.2g}"


@dataclass(frozen=True)
class MomentumBalance(Record):
    """The balance, and the law at its first point, its mean and its last point.

    Attributes:
        differences: none where the law has no meaning.
    """

    title = "Momentum balance"
    notes = (
        "The momentum balance integrates the weight of the grains and their acceleration down to "
        "each cell, with derivatives of the vectors themselves. It uses no network."
    )

    balance: Baseline
    differences: tuple[Difference, ...] = ()

    @property
    def words(self) -> str:
        text = str(self.balance)
        if self.differences:
            text += f"; the network's law differs by {', '.join(map(str, self.differences))}"
        return text

    def reasons(self, result: Result) -> list[Reason]:
        if self.balance.carried:
            text = "Walls carry the grains, by forces that are not known"
            return [Reason(BAD, f"{text}: {self.balance.reason}.")]
        farthest = max(self.differences, key=lambda d: d.standard_errors, default=None)
        if farthest is None:
            return []
        what = "the momentum balance without a network"
        if farthest.standard_errors > SIGNIFICANT:
            text = f"The law differs from {what} by {farthest}: one of them is wrong."
            return [Reason(CARE, text)]
        return [Reason(GOOD, f"{what.capitalize()} agrees: the law differs by {farthest}.")]


def without_error_bars(result: Result) -> Result:
    """The result of a flow whose grains hang on walls.

    The equations hold there too, but nothing is known of the forces of the walls: the law was
    wrong by a factor of two in a silo (bench/studies/grains/note.md).
    """
    parameters = {
        name: replace(p, std=None, interval_90=None) for name, p in result.parameters.items()
    }
    curve = result.law.curve
    if curve is not None:
        curve = replace(curve, low=None, high=None)
    return replace(
        result,
        parameters=Parameters(parameters),
        covariance=None,
        error_bars=None,
        law=replace(result.law, curve=curve, reason=CARRIED),
    )


def prepare(case: Case) -> None:
    """Make the balance before the training ends, unless the training identifies its scale."""
    name = case.member.law.inertial_scale
    scale = I0 if name is None else case.member.fixed.get(name)
    if scale is not None:
        case.balance(scale)


def make(context: Context) -> MomentumBalance:
    case, result = context.case, context.result
    name = result.friction_law.inertial_scale
    found = case.balance(I0 if name is None else result.parameters[name].value)
    if undetermined(case.seen, result.level) is not None:
        return MomentumBalance(found)  # the network's law has no meaning
    if found.carried:
        context.result = without_error_bars(result)
    return MomentumBalance(found, tuple(difference(point, result) for point in found.shown))


def difference(point: Point, result: Result) -> Difference:
    """Without error bars of the result, the balance has all of the standard error."""
    at = np.array([point.I])
    mu = float(result.friction_law.friction(at, *result.theta)[0])
    sd = 0.0
    if result.covariance is not None:
        sd = float(friction_sd(at, result, result.covariance)[0])
    percent = 100 * (mu / point.mu - 1)
    se = 100 * float(np.hypot(sd / point.mu, mu * point.se / point.mu**2))
    return Difference(point.I, percent, se)


CHECK = Check("momentum_balance", MomentumBalance, make, seconds=1.0)
