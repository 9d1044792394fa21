"""May these numbers be used? A list of conditions, and the reasons of all checks, decide.

A condition has a grade and a sentence for the results that it holds for. So has a check, for what
it found. The grade of a result is the worst one among them; those of grade "good" are facts that
speak for it. No other place judges.
`python -m bench.studies.coverage.assessment` measures the grades on flows whose law is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from granpinn.physics.laws import mu_of_i
from granpinn.results.parameters import NOT_DETERMINED, USELESS, half_width, spans
from granpinn.results.record import BAD, CARE, GOOD, IMPROBABLE, UNUSUAL

if TYPE_CHECKING:
    from granpinn.results.result import Result

GRADES = (BAD, CARE, GOOD)  # the worst first
HEADLINES = {GOOD: "good to use", CARE: "use with care", BAD: "do not use"}

# Rms residual of the momentum equation over the weight of the grains. In simulated flows of mu(I)
# it is at most 0.04 after 1,000 steps or more, and 0.05 in films; a fluid of constant viscosity has
# 0.03 to 0.08, a film played backwards 0.18 to 0.7 (bench/studies/coverage).
UNBALANCED, CONTRADICTED = 0.05, 0.15
SETTLED, AFTER_1000 = 3000, 0.03  # a larger residual shows a training of fewer steps than the first
WIDE = 0.1  # half of the 90 % interval, of log mu


@dataclass(frozen=True)
class Assessment:
    """May these numbers be used?

    Attributes:
        grade: "good", "care" or "do not use".
        headline: the same for a reader.
        reasons: whole sentences, the worst first; behind those of the grade follow milder ones.
    """

    grade: str
    headline: str
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        """The line for the terminal, with the first reason."""
        return f"{self.headline}: {self.reasons[0]}" if self.reasons else f"{self.headline}."


def assess(result: Result) -> Assessment:
    """The assessment of a result: every condition that holds for it, and what its checks say."""
    checks = [reason for record in result.checks.values() for reason in record.reasons(result)]
    found = [(r.grade, r.sentence) for r in checks if r.grade == BAD]  # what they exclude is first
    found += [(c.grade, said) for c in CONDITIONS if (said := c.said(result)) is not None]
    found += [(r.grade, r.sentence) for r in checks if r.grade != BAD]
    found.sort(key=lambda pair: GRADES.index(pair[0]))
    grade = found[0][0] if found else CARE
    return Assessment(grade, HEADLINES[grade], tuple(said for _, said in found))


def evidence(r: Result) -> str:
    """Why a result has its grade, in one line without the numbers of its law.

    For "good" what was tested, up to the colon of each reason; else the first reason.
    """
    assessment = assess(r)
    if assessment.grade != GOOD:
        return assessment.reasons[0].removesuffix(".") if assessment.reasons else "nothing is known"
    checks = [reason for record in r.checks.values() for reason in record.reasons(r)]
    tested = [
        balanced(r),
        *(reason.sentence for reason in checks if reason.grade == GOOD),
        fitted(r),
    ]
    claims = [said.partition(":")[0].removesuffix(".") for said in tested if said is not None]
    claims = claims or [said.removesuffix(".") for said in assessment.reasons[:1]]
    return "; ".join(claim[0].lower() + claim[1:] for claim in claims)


def diverged(r: Result) -> str | None:
    if r.failure is None and r.stopped != "diverged":
        return None
    return f"The training diverged: {r.failure or 'its last good state is shown'}."


def undetermined(r: Result) -> str | None:
    return f"No friction coefficient is determined: {r.no_law}." if r.no_law else None


def slips(grade: str) -> Callable[[Result], str | None]:
    """The likely mistakes of a grade in the flow file."""

    def said(r: Result) -> str | None:
        found = [slip.sentence for slip in r.data.slips if slip.grade == grade]
        return f"The data are {grade}: {'; '.join(found)}." if found else None

    return said


def of_flows(grade: str) -> Callable[[Result], str | None]:
    """What limits the flows of one law that have a grade."""

    def said(r: Result) -> str | None:
        found = [
            f"{flow.input.name}: {flow.assessment.reasons[0]}"
            for flow in r.flows
            if flow.assessment.grade == grade and flow.assessment.reasons
        ]
        return " ".join(found) or None

    return said


def unsettled(r: Result) -> str | None:
    """Equations that do not hold yet: their residual falls in proportion to the steps."""
    momentum = _momentum(r)
    if momentum is None or momentum <= UNBALANCED or r.timing.steps >= SETTLED:
        return None
    return f"The training has not settled: {_forces(momentum)}. {_longer(r, momentum / AFTER_1000)}"


def contradicted(r: Result) -> str | None:
    """Equations that do not hold in the default recipe; others are not tested."""
    momentum = _momentum(r)
    if momentum is None or momentum <= CONTRADICTED or r.timing.steps < SETTLED:
        return None
    if r.error_bars is None:
        return None
    return (
        f"The data contradict the law: {_forces(momentum)}, and in flows that follow it by less "
        f"than {UNBALANCED:.0%}."
    )


def unbalanced(r: Result) -> str | None:
    momentum = _momentum(r)
    if momentum is None or momentum <= UNBALANCED or contradicted(r) or unsettled(r):
        return None
    return (
        f"The equations hold less well than in simulated flows: {_forces(momentum)}, and there by "
        f"less than {UNBALANCED:.0%}."
    )


def balanced(r: Result) -> str | None:
    momentum = _momentum(r)
    if momentum is None or momentum > UNBALANCED:
        return None
    return f"The equations hold: {_forces(momentum)}, as in simulated flows."


def fitted(r: Result) -> str | None:
    """How well the velocity fits; noise of the vectors is no misfit."""
    if r.residuals is None:
        return None
    misfit, noise = r.residuals.velocity, r.residuals.noise or r.data.measured_noise or 0.0
    words = f"The velocity fits the vectors to {100 * misfit:.2g} %"
    return f"{words}, with noise of {100 * noise:.2g} %." if noise > misfit / 2 else f"{words}."


def _momentum(r: Result) -> float | None:
    return None if r.residuals is None else r.residuals.get("momentum")


def _forces(momentum: float) -> str:
    return f"the forces of the fit are out of balance by {momentum:.2g} of the weight of the grains"


def useless(r: Result) -> str | None:
    found = _widest(r)
    if found is None or found.half <= USELESS:
        return None
    if r.timing.steps >= SETTLED:
        return f"{found.words}; these data do not tell more."
    return f"{found.words}. {_longer(r, found.half / WIDE)}"


def wide(r: Result) -> str | None:
    found = _widest(r)
    return f"{found.words}." if found is not None and WIDE < found.half <= USELESS else None


def known(r: Result) -> str | None:
    found = _widest(r)
    return f"{found.words}." if found is not None and found.half <= WIDE else None


class Width(NamedTuple):
    """Half of the widest 90 % interval, of the logarithm, and what it says in words."""

    half: float
    words: str


def _widest(r: Result) -> Width | None:
    """Of mu(I) over the I of the data. Where it is wide, or has no band, those of the parameters
    count as well. None without any interval."""
    found, curve = [], r.law.curve
    if curve is not None and curve.low is not None and curve.high is not None:
        halves = [*map(half_width, zip(curve.low, curve.high, strict=True))]
        half = max(halves)
        at = f"{curve.band(0)} at I = {curve.I[0]:.2g}"
        if curve.I[-1] > curve.I[0]:
            at += f" to {curve.band(-1)} at I = {curve.I[-1]:.2g}"
        words = f"mu(I) is known to {_words(half)}: {at} (90 % intervals)"
        if half > USELESS:
            at = f"I = {curve.I[halves.index(half)]:.2g}"
            words = f"mu(I) is {NOT_DETERMINED} at {at}: {spans(half)}"
        found.append(Width(half, words))
        if half <= WIDE:
            return found[0]
    for name, p in r.parameters.items():
        if p.interval_90 is not None:
            half = half_width(p.interval_90)
            if p.determined:
                found.append(Width(half, f"{name} is known to {_words(half)}: {p.words} (90 %)"))
            elif p.undetermined == spans(half):
                found.append(Width(half, f"{name} is {NOT_DETERMINED}: {p.undetermined}"))
    return max(found, key=lambda width: width.half, default=None)


def _words(half: float) -> str:
    return f"+- {100 * half:.2g} %"


def _longer(r: Result, times: float) -> str:
    """What to do, as errors fall in proportion to the steps."""
    steps = max(SETTLED, 1000 * math.ceil(r.timing.steps * times / 1000))
    return f"Train longer: about {steps:,} steps in place of {r.timing.steps:,}."


def without_errors(r: Result) -> str | None:
    if _widest(r) is not None or diverged(r) or undetermined(r):
        return None
    return f"The errors are not known: {r.law.reason or 'none were estimated'}."


def untested(r: Result) -> str | None:
    if r.error_bars is None or not r.error_bars.outside:
        return None
    return f"The error bars are not tested here: {'; '.join(r.error_bars.outside)}."


def extrapolated(r: Result) -> str | None:
    """mu_2 beyond the I of the data: no fault of mu(I)."""
    if (reach := reach_of(r)) is None:
        return None
    words = r.parameters["mu_2"].words
    return f"mu_2, {words}, is extrapolated: the flow reaches {reach:.2g} I0."


def reach_of(r: Result) -> float | None:
    """The largest I of the data over I0, where mu_2 is extrapolated; else None."""
    if r.law.name != mu_of_i.LAW.name or r.law.I_range is None:
        return None
    mu_2, reach = r.parameters["mu_2"], r.law.I_range[1] / r.parameters["I0"].value
    return None if mu_2.fixed or not mu_2.determined or reach >= 1 else reach


class Condition(NamedTuple):
    """The sentence of a condition for a result, None where it does not hold."""

    grade: str
    said: Callable[[Result], str | None]


CONDITIONS = (
    Condition(BAD, diverged),
    Condition(BAD, undetermined),
    Condition(BAD, slips(IMPROBABLE)),
    Condition(BAD, of_flows(BAD)),
    Condition(BAD, unsettled),
    Condition(BAD, useless),
    Condition(BAD, contradicted),
    Condition(CARE, wide),
    Condition(CARE, without_errors),
    Condition(CARE, unbalanced),
    Condition(CARE, untested),
    Condition(CARE, slips(UNUSUAL)),
    Condition(CARE, of_flows(CARE)),
    Condition(GOOD, known),
    Condition(GOOD, extrapolated),
    Condition(GOOD, balanced),
    Condition(GOOD, fitted),
)
