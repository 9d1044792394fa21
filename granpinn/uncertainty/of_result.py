"""The headline of a report: may these numbers be used? With the reasons against it.

The records of results.json and history.csv decide, among them the verdict on the law (of_law).
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from granpinn.results import Result
from granpinn.results.summary import Summary, summarize
from granpinn.training.history import HistoryFileError, read_history

# Parameters that still change by more over the last tenth of the steps are not final.
DRIFT_CARE, DRIFT_BAD = 0.01, 0.05
# Misfit of the velocity in %; measurement noise counts, so that only a gross one is final.
MISFIT_CARE, MISFIT_BAD = 5.0, 50.0
WIDE = 0.1  # half-width of a 90 % interval, relative to the value
# Of mu(I): at I = I0/2 the law has gone a third of the way from mu_s to mu_2.
REACH = 0.5
HEADLINES = {
    "good": "the friction law is identified.",
    "care": "to be used with care.",
    "bad": "not to be used.",
}
UNKNOWN = "not to be used: the errors are not known yet."


class Assessment(NamedTuple):
    """`grade` is "good", "care" or "bad"; `reasons` are whole sentences, the worst first."""

    grade: str
    headline: str
    reasons: tuple[str, ...]


def assess(result: Result, summary: Summary) -> Assessment:
    """The verdict on a result."""
    bad, care, good = _training(result, summary)
    care += [f"The data are {slip}." for slip in result.data.slips]
    unknown = _without_errors(result)
    bad += unknown
    for name in result.parameters:
        wide, sentence = _interval(result, name)
        if sentence:
            (care if wide else good).append(sentence)
    if summary.reaches is not None and summary.reaches < REACH:
        care.append(
            f"The flow reaches only {summary.reaches:.2g} of I₀, so that μ₂ is an extrapolation: "
            "use μ(I) over the inertial numbers of the figure."
        )
    if result.determined is not None and result.determined.lost:
        care.append(f"{result.determined}.")
    if result.baseline is not None and result.baseline.warning is not None:
        text = result.baseline.warning.removeprefix("warning: ")
        care.append(f"{text[0].upper()}{text[1:]}.")
    law = result.verdict
    if law is not None and law.follows is False:
        bad.append(f"The data contradict the friction law: {law.words}.")
    grade = "bad" if bad else "care" if care else "good"
    words = UNKNOWN if bad == unknown and bad else HEADLINES[grade]
    return Assessment(grade, words, (*bad, *care, *good))


def headline(result: Result, history: Path) -> str:
    """The verdict of the page in a line; `history`: history.csv, which may be missing."""
    try:
        course = read_history(history, result.friction_law)
    except HistoryFileError:
        course = None
    return assess(result, summarize(result, course)).headline


def _without_errors(result: Result) -> list[str]:
    """The sentence on a law that has neither an interval nor a band; the terminal has it too."""
    free = [p for _, p in result.parameters.items() if not p.fixed]
    curve, at_mean = result.law.curve, result.determined
    known = any(p.interval_90 is not None for p in free)
    known |= at_mean is not None and at_mean.interval_90 is not None
    if known or (curve is not None and curve.low is not None):
        return []
    if at_mean is not None and at_mean.reason is not None:
        why = at_mean.reason
    elif result.verdict is not None and result.verdict.follows is None:
        why = result.verdict.words
    else:
        why = "none were estimated"
    return [f"The errors are not known: {why}."]


def _training(result: Result, summary: Summary) -> tuple[list[str], list[str], list[str]]:
    """Sentences on the course of the training, by grade: bad, care, good."""
    bad: list[str] = []
    care: list[str] = []
    good: list[str] = []
    if result.stopped == "diverged" or result.failure is not None:
        bad.append(f"The training diverged: {result.failure or 'its last good state is shown'}.")
    if summary.drift is not None:
        drift = max(summary.drift.values())
        symbols = " and ".join(summary.drift)
        words = f"{symbols} changed by up to {100 * drift:.2g} % over the last tenth of the steps"
        if drift > DRIFT_CARE:
            (bad if drift > DRIFT_BAD else care).append(f"{words}: train with more steps.")
        else:
            good.append(f"{words}.")
    misfit = result.error_percent.velocity
    if misfit is not None and misfit > MISFIT_CARE:
        (bad if misfit > MISFIT_BAD else care).append(
            f"The velocity of the file is missed by {misfit:.2g} %: is that its noise? "
            "If not, train longer or doubt the model."
        )
    return bad, care, good


def _interval(result: Result, name: str) -> tuple[bool, str]:
    """Whether the interval of a parameter needs care, and the sentence; "" if it is fixed."""
    parameter = result.parameters[name]
    symbol = result.friction_law.parameter(name).text
    if parameter.fixed or not parameter.determined:
        return False, ""
    if parameter.interval_90 is None:
        return True, f"{symbol} has no interval: its digits are not its accuracy."
    low, high = parameter.interval_90
    half = (high - low) / 2 / abs(parameter.value) if parameter.value else float("inf")
    text = f"{symbol} lies between {low:.3f} and {high:.3f} (90 % interval, ± {100 * half:.2g} %)"
    return half > WIDE, f"{text}: a wide one." if half > WIDE else f"{text}."
