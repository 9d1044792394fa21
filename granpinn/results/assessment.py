"""May these numbers be used? A list of conditions, and the reasons of all checks, decide.

A condition has a grade and a sentence for the results that it holds for. So has a check, for what
it found. The grade of a result is the worst one among them; those of grade "good" are facts that
speak for it. No other place judges.
`python -m bench.studies.coverage.assessment` measures the grades on flows whose law is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from granpinn.physics.laws import mu_of_i
from granpinn.results.parameters import NOT_DETERMINED, USELESS, half_width, spans
from granpinn.results.record import BAD, CARE, GOOD, IMPROBABLE, UNUSUAL, Reason

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
    found = [reason for reason in checks if reason.grade == BAD]  # what they exclude is first
    found += conditions(result)
    found += [reason for reason in checks if reason.grade != BAD]
    found.sort(key=lambda reason: GRADES.index(reason.grade))
    grade = found[0].grade if found else CARE
    return Assessment(grade, HEADLINES[grade], tuple(reason.sentence for reason in found))


def conditions(r: Result) -> list[Reason]:
    """The conditions that hold for a result, in the order of their grades' reasons."""
    found: list[Reason] = []

    def hold(grade: str, sentence: str) -> None:
        found.append(Reason(grade, sentence))

    diverged = r.failure is not None or r.stopped == "diverged"
    if diverged:
        hold(BAD, f"The training diverged: {r.failure or 'its last good state is shown'}.")
    if r.no_law is not None:
        hold(BAD, f"No friction coefficient is determined: {r.no_law}.")
    found += _of_data(r, IMPROBABLE, BAD)
    balance, width = _balance(r), _width(r)
    if balance is not None and balance.grade == BAD and r.timing.steps < SETTLED:
        found.append(balance)  # a short training explains a wide interval
        balance = None
    if width is not None:
        found.append(width)
    elif not diverged and r.no_law is None:
        hold(CARE, f"The errors are not known: {r.law.reason or 'none were estimated'}.")
    if (reach := reach_of(r)) is not None:  # no fault of mu(I)
        words = r.parameters["mu_2"].words
        hold(GOOD, f"mu_2, {words}, is extrapolated: the flow reaches {reach:.2g} I0.")
    found += [] if balance is None else [balance]
    if r.error_bars is not None and r.error_bars.outside:
        hold(CARE, f"The error bars are not tested here: {'; '.join(r.error_bars.outside)}.")
    found += _of_data(r, UNUSUAL, CARE)
    return found + _fit(r)


def evidence(r: Result) -> str:
    """Why a result has its grade, in one line without the numbers of its law.

    For "good" what was tested, up to the colon of each reason; else the first reason.
    """
    assessment = assess(r)
    if assessment.grade != GOOD:
        return assessment.reasons[0].removesuffix(".") if assessment.reasons else "nothing is known"
    balance = _balance(r)
    tested = [] if balance is None else [balance]
    checks = [reason for record in r.checks.values() for reason in record.reasons(r)]
    tested += [*(reason for reason in checks if reason.grade == GOOD), *_fit(r)]
    sentences = [reason.sentence for reason in tested] or assessment.reasons[:1]
    claims = [said.partition(":")[0].removesuffix(".") for said in sentences]
    return "; ".join(claim[0].lower() + claim[1:] for claim in claims)


def _of_data(r: Result, slip: str, grade: str) -> list[Reason]:
    """The likely mistakes in the flow file, and what limits the flows of one law, of a grade."""
    slips = [found.sentence for found in r.data.slips if found.grade == slip]
    flows = [
        f"{flow.input.name}: {flow.assessment.reasons[0]}"
        for flow in r.flows
        if flow.assessment.grade == grade and flow.assessment.reasons
    ]
    found = [f"The data are {slip}: {'; '.join(slips)}."] if slips else []
    return [Reason(grade, said) for said in [*found, *([" ".join(flows)] if flows else [])]]


def _balance(r: Result) -> Reason | None:
    """Whether the equations hold: the residual falls in proportion to the steps.

    Data contradict the law only in the default recipe; others are not tested.
    """
    momentum = None if r.residuals is None else r.residuals.get("momentum")
    if momentum is None:
        return None
    forces = (
        f"the forces of the fit are out of balance by {momentum:.2g} of the weight of the grains"
    )
    if momentum <= UNBALANCED:
        return Reason(GOOD, f"The equations hold: {forces}, as in simulated flows.")
    if r.timing.steps < SETTLED:
        longer = _longer(r, momentum / AFTER_1000)
        return Reason(BAD, f"The training has not settled: {forces}. {longer}")
    if momentum > CONTRADICTED and r.error_bars is not None:
        return Reason(
            BAD,
            f"The data contradict the law: {forces}, and in flows that follow it by less than "
            f"{UNBALANCED:.0%}.",
        )
    return Reason(
        CARE,
        f"The equations hold less well than in simulated flows: {forces}, and there by less than "
        f"{UNBALANCED:.0%}.",
    )


def _fit(r: Result) -> list[Reason]:
    """How well the velocity fits; noise of the vectors is no misfit."""
    if r.residuals is None:
        return []
    misfit, noise = r.residuals.velocity, r.residuals.noise or r.data.measured_noise or 0.0
    words = f"The velocity fits the vectors to {100 * misfit:.2g} %"
    words += f", with noise of {100 * noise:.2g} %." if noise > misfit / 2 else "."
    return [Reason(GOOD, words)]


def _width(r: Result) -> Reason | None:
    """What the widest interval says; None without any."""
    half, words = max(_widths(r), key=lambda pair: pair[0], default=(0.0, None))
    if words is None:
        return None
    if half <= USELESS:
        return Reason(CARE if half > WIDE else GOOD, f"{words}.")
    if r.timing.steps >= SETTLED:
        return Reason(BAD, f"{words}; these data do not tell more.")
    return Reason(BAD, f"{words}. {_longer(r, half / WIDE)}")


def _widths(r: Result) -> list[tuple[float, str]]:
    """Halves of 90 % intervals, of the logarithm, and what they say in words.

    Of mu(I) over the I of the data. Where it is wide, or has no band, those of the parameters count
    as well.
    """
    found, curve = [], r.law.curve
    if curve is not None and curve.low is not None and curve.high is not None:
        halves = [*map(half_width, zip(curve.low, curve.high, strict=True))]
        half = max(halves)
        at = curve.at_ends(curve.band)
        words = f"mu(I) is known to {_words(half)}: {at} (90 % intervals)"
        if half > USELESS:
            at = f"I = {curve.I[halves.index(half)]:.2g}"
            words = f"mu(I) is {NOT_DETERMINED} at {at}: {spans(half)}"
        found.append((half, words))
        if half <= WIDE:
            return found
    for name, p in r.parameters.items():
        if p.interval_90 is None:
            continue
        half = half_width(p.interval_90)
        if p.determined:
            found.append((half, f"{name} is known to {_words(half)}: {p.words} (90 %)"))
        elif p.undetermined == spans(half):
            found.append((half, f"{name} is {NOT_DETERMINED}: {p.undetermined}"))
    return found


def _words(half: float) -> str:
    return f"+- {100 * half:.2g} %"


def _longer(r: Result, times: float) -> str:
    """What to do, as errors fall in proportion to the steps."""
    steps = max(SETTLED, 1000 * math.ceil(r.timing.steps * times / 1000))
    return f"Train longer: about {steps:,} steps in place of {r.timing.steps:,}."


def reach_of(r: Result) -> float | None:
    """The largest I of the data over I0, where mu_2 is extrapolated; else None."""
    if r.law.name != mu_of_i.LAW.name or r.law.I_range is None:
        return None
    mu_2, reach = r.parameters["mu_2"], r.law.I_range[1] / r.parameters["I0"].value
    return None if mu_2.fixed or not mu_2.determined or reach >= 1 else reach
