"""The momentum balance beside an identified law."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from granpinn.checks.momentum_balance import CARRIED, CHECK, make
from granpinn.config import Config
from granpinn.data import Flow
from granpinn.fit.context import Context
from granpinn.inspection.momentum_balance import Baseline, baseline
from granpinn.physics.laws import mu_of_i
from granpinn.results import Parameter, Parameters, Result
from tests.examples import make_result
from tests.inspection.chutes import TANGENT, chute


def result_with(factor: float) -> Result:
    """A law whose friction is `factor` times that of the chutes, without error bars."""
    values = {
        "mu_s": Parameter(0.3 * factor, fixed=False),
        "mu_2": Parameter(0.7 * factor, fixed=False),
        "I0": Parameter(0.3, fixed=True),
    }
    return make_result(parameters=Parameters(values), covariance=None, checks={})


def context_of(flow: Flow, result: Result) -> Any:
    """What the check needs of a fit."""
    member = SimpleNamespace(law=mu_of_i.LAW, fixed={"I0": 0.3})
    return Context(
        result=result,
        case=SimpleNamespace(seen=flow, balance=partial(baseline, flow), member=member),  # type: ignore[arg-type]
        network=None,  # type: ignore[arg-type]
        run=None,  # type: ignore[arg-type]
        place=0,
    )


def test_a_right_law_does_not_warn() -> None:
    found = make(context_of(chute(), result_with(1.0)))
    assert [d.percent for d in found.differences] == pytest.approx([0], abs=1)
    assert make_result(checks={"momentum_balance": found}).assessment.grade == "good"
    assert "the network's law differs by" in str(found)
    assert found.balance.mean is not None
    assert found.balance.mean.mu == pytest.approx(TANGENT, rel=1e-4)


@pytest.mark.parametrize("factor", [0.85, 1.2])
def test_a_wrong_law_warns(factor: float) -> None:
    found = make(context_of(chute(), result_with(factor)))
    (difference,) = found.differences
    assert difference.percent == pytest.approx(100 * (factor - 1), abs=1)
    reason = make_result(checks={"momentum_balance": found}).assessment.reasons[0]
    assert "differs from the momentum balance" in reason


def test_grains_that_walls_carry_get_no_error_bars() -> None:
    context = context_of(replace(chute(), u=-chute().u), make_result(checks={}))
    before = context.result
    context.attempt(CHECK.name, lambda: CHECK.make(context))
    made = context.result
    assert made.checks["momentum_balance"].balance.carried
    assert made.theta == before.theta
    assert made.covariance is None
    assert made.error_bars is None
    assert made.parameters["mu_s"].interval_90 is None
    assert made.law.curve.low is None
    assert made.assessment.reasons[0].startswith("Walls carry the grains")
    assert made.law.reason == CARRIED


def test_a_failure_of_the_balance_is_not_one_of_the_run() -> None:
    def fail(I0: float) -> Baseline:
        raise RuntimeError("singular")

    context = context_of(chute(), result_with(1.0))
    context.case.balance = fail
    context.attempt(CHECK.name, lambda: CHECK.make(context))
    assert context.result.not_done == {"momentum_balance": "RuntimeError: singular"}
    assert context.result.checks == {}
    assert not CHECK.asked(Config())
