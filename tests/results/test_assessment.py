"""The assessment: every condition, the worst grade, and the one place that all outputs show."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from granpinn.checks.comparison_of_laws import CHOSEN, EXCLUDED, ComparedLaw, LawComparison
from granpinn.checks.momentum_balance import Difference, MomentumBalance
from granpinn.inspection.momentum_balance import Baseline
from granpinn.results import (
    Parameter,
    Parameters,
    Residuals,
    Result,
    Timing,
    read_results,
    write_results,
)
from granpinn.results.assessment import GRADES, Assessment, conditions
from granpinn.results.parameters import half_width, spans
from granpinn.results.record import Reason
from granpinn.results.records import Curve
from granpinn.results.result import FlowOfLaw
from tests.examples import BASELINE, make_result

EXAMPLE = make_result()


def residuals(momentum: float) -> Residuals:
    assert EXAMPLE.residuals is not None
    return Residuals({**EXAMPLE.residuals, "momentum": momentum})


def law(factor: float | None, reason: str | None = None) -> Any:
    """The law of the example with a band of `factor` around it, None without a band."""
    curve = EXAMPLE.law.curve
    assert curve is not None
    ends = [None if factor is None else tuple(m * f for m in curve.mu) for f in (1, factor)]
    low = None if factor is None else tuple(m / factor for m in curve.mu)
    return replace(EXAMPLE.law, curve=Curve(curve.I, curve.mu, low, ends[1]), reason=reason)


def without_bars(**changes: Any) -> dict[str, Any]:
    values = {name: replace(p, std=None, interval_90=None) for name, p in ITEMS}
    bare = {"error_bars": None, "covariance": None, "law": law(None, "too few steps")}
    return {"parameters": Parameters(values), **bare, **changes}


ITEMS = [*EXAMPLE.parameters.items()]


LARGE_MU_2 = Parameters(
    dict(ITEMS) | {"mu_2": Parameter(0.7, fixed=False, interval_90=(0.11, 4.95))}
)


LOST_MU_2 = {
    "parameters": Parameters(
        dict(ITEMS)
        | {
            "mu_2": Parameter(
                0.7,
                fixed=False,
                interval_90=(0.11, 4.95),
                undetermined=spans(half_width((0.11, 4.95))),
            )
        }
    ),
}


ALIKE = Parameters(mu_s=Parameter(0.4, fixed=False))


LAWS = (
    ComparedLaw("coulomb", CHOSEN, ALIKE),
    ComparedLaw("mu_of_i", EXCLUDED, EXAMPLE.parameters),
)


SHORT, LONG = (Timing(1.0, steps) for steps in (900, 15_000))


def slips(severity: str) -> dict[str, Any]:
    return {"data": replace(EXAMPLE.data, slips=(Reason(severity, "the scale is wrong"),))}


def far(percent: float) -> dict[str, Any]:
    differences = (Difference(0.01, 0.0, 2.0), Difference(0.2, percent, 5.0))
    return {"checks": {"momentum_balance": MomentumBalance(BASELINE, differences)}}


def outside() -> dict[str, Any]:
    assert EXAMPLE.error_bars is not None
    return {"error_bars": replace(EXAMPLE.error_bars, outside=("mu_2/mu_s = 2.9 (tested: to 2)",))}


def of_flows(grade: str) -> dict[str, Any]:
    limited = Assessment(grade, "a headline", ("It is noisy.",))
    bad = replace(EXAMPLE.input, name="b.h5")
    good = FlowOfLaw(EXAMPLE.input, EXAMPLE.data, None, Assessment("good", "good", ("Yes.",)))
    return {"flows": (good, FlowOfLaw(bad, EXAMPLE.data, None, limited))}


# Changes of a result that is good, its grade then, and words of the first reason.
CASES: dict[str, tuple[dict[str, Any], str, str]] = {
    "as it is": ({}, "good", "mu(I) is known to +- 6.1 %: 0.420 (0.400 to 0.440) at I = 0.01"),
    "diverged": ({"stopped": "diverged", "failure": "a NaN"}, "do not use", "diverged: a NaN."),
    "undetermined": (
        {"no_law": "walls drive it"},
        "do not use",
        "No friction coefficient is determined: walls drive it.",
    ),
    "carried": (
        {"checks": {"momentum_balance": MomentumBalance(Baseline("they hang", carried=True))}},
        "do not use",
        "Walls carry the grains, by forces that are not known: they hang.",
    ),
    "improbable": (slips("improbable"), "do not use", "The data are improbable: the scale is"),
    "unusual": (slips("unusual"), "care", "The data are unusual: the scale is wrong."),
    "unsettled": (
        {"residuals": residuals(0.3), "timing": SHORT},
        "do not use",
        "The training has not settled: the forces of the fit are out of balance by 0.3 of the "
        "weight of the grains. Train longer: about 9,000 steps in place of 900.",
    ),
    "contradicted": (
        {"residuals": residuals(0.3), "timing": LONG},
        "do not use",
        "The data contradict the law: the forces of the fit are out of balance by 0.3 of",
    ),
    "not tested, hence no contradiction": (
        without_bars(residuals=residuals(0.3), timing=LONG),
        "care",
        "The errors are not known: too few steps.",
    ),
    "unbalanced": ({"residuals": residuals(0.06)}, "care", "The equations hold less well than"),
    "balanced": ({"residuals": residuals(0.05)}, "good", "mu(I) is known to"),
    "useless, short": (
        {"law": law(2.0), "timing": SHORT} | LOST_MU_2,
        "do not use",
        "mu_2 is not determined: its 90 % interval spans a factor of 45. Train longer: about 18,",
    ),
    "useless, long": (
        {"law": law(1.8), "timing": LONG},
        "do not use",
        "mu(I) is not determined at I = 0.01: its 90 % interval spans a factor of 3.2; these data",
    ),
    "wide": ({"law": law(1.2)}, "care", "mu(I) is known to +- 18 %"),
    "only mu_2 is not determined": ({"law": law(1.05)} | LOST_MU_2, "good", "+- 4.9 %"),
    "only mu_2 is wide": ({"law": law(1.05), "parameters": LARGE_MU_2}, "good", "+- 4.9 %"),
    "no errors": (without_bars(), "care", "The errors are not known: too few steps."),
    "no band": ({"law": law(None)}, "good", "mu_s is known to +- 4.9 %: 0.41 (0.39 to 0.43)"),
    "outside": (outside(), "care", "The error bars are not tested here: mu_2/mu_s = 2.9 (tested"),
    "disagreeing": (far(-16.0), "care", "by -16.0 +- 5.0 % at I = 0.2: one of them is wrong."),
    "agreeing": (far(-14.0), "good", "mu(I) is known to"),
    "another law": (
        {"checks": {"comparison_of_laws": LawComparison(LAWS)}},
        "care",
        "The data support another law: a constant friction of 0.4 explains these data",
    ),
    "one of its flows": (of_flows("care"), "care", "b.h5: It is noisy."),
    "a bad one of its flows": (of_flows("do not use"), "do not use", "b.h5: It is noisy."),
}


@pytest.mark.parametrize("name", CASES)
def test_a_condition_has_its_grade_and_comes_first(name: str) -> None:
    changes, grade, words = CASES[name]
    found = make_result(**changes).assessment
    assert found.grade == grade
    assert words in found.reasons[0]
    assert found.reasons[0].endswith(".")
    assert str(found).startswith(f"{found.headline}: {found.reasons[0][:9]}")


def test_reasons_are_ordered_by_their_grades() -> None:
    result = make_result(**slips("improbable"), **outside(), residuals=residuals(0.06))
    said = {reason.sentence: reason.grade for reason in conditions(result)}
    reasons = [r for record in result.checks.values() for r in record.reasons(result)]
    said |= {reason.sentence: reason.grade for reason in reasons}
    grades = [said[reason] for reason in result.assessment.reasons]
    assert grades == sorted(grades, key=GRADES.index)
    assert set(grades) == set(GRADES)


@pytest.mark.parametrize("changes", [{}, slips("improbable"), without_bars()])
def test_all_outputs_have_the_same_answer(changes: dict[str, Any], tmp_path: Path) -> None:
    result: Result = make_result(**changes)
    found, path = result.assessment, tmp_path / "results.json"
    write_results(result, path)
    stored = json.loads(path.read_text())
    assert list(stored)[2] == "assessment"
    assert stored["assessment"]["grade"] == found.grade
    assert tuple(stored["assessment"]["reasons"]) == found.reasons
    assert read_results(path).assessment == found
    assert result.summary().splitlines()[-1] == f"assessment: {found}"
    assert result._repr_html_().startswith(f"<p>{found.headline}: ")
