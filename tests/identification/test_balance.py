"""The momentum balance beside an identified law."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from granpinn.config import SideWalls
from granpinn.data import Flow
from granpinn.identification import balance, judgement
from granpinn.identification.balance import Balance
from granpinn.identification.of_flow import OfFlow
from granpinn.identification.single import made_ahead
from granpinn.inspection.baseline import baseline
from granpinn.physics.laws import mu_of_i
from granpinn.results import NotDone, Parameter, Parameters, Result
from granpinn.results.attempt import BASELINE, asked_for
from granpinn.results.baseline import Baseline
from granpinn.second_opinion.threads import threads
from tests.examples import make_result
from tests.inspection.chutes import TANGENT, chute


def result_with(factor: float) -> Result:
    """A law whose friction is `factor` times that of the chutes, without error bars."""
    values = {
        "mu_s": Parameter(0.3 * factor, fixed=False),
        "mu_2": Parameter(0.7 * factor, fixed=False),
        "I0": Parameter(0.3, fixed=True),
    }
    return make_result(parameters=Parameters(values), covariance=None, baseline=None)


def case_of(of_flow: Balance, fixed: dict[str, float]) -> Any:
    """What `made_ahead` needs of a case."""
    return SimpleNamespace(
        balance=of_flow,
        of_flow=OfFlow(of_flow.flow),
        config=SimpleNamespace(level="V1"),
        member=SimpleNamespace(law=mu_of_i.LAW, fixed=fixed),
    )


def test_a_right_law_does_not_warn() -> None:
    found = balance.beside(Balance(chute()), result_with(1.0))
    assert [d.percent for d in found.network] == pytest.approx([0], abs=1)
    assert make_result(baseline=found).assessment.grade == "good"
    assert "the network's law differs by" in str(found)
    assert found.mean is not None
    assert found.mean.mu == pytest.approx(TANGENT, rel=1e-4)


@pytest.mark.parametrize("factor", [0.85, 1.2])
def test_a_wrong_law_warns(factor: float) -> None:
    found = balance.beside(Balance(chute()), result_with(factor))
    (difference,) = found.network
    assert difference.percent == pytest.approx(100 * (factor - 1), abs=1)
    assert "differs from the momentum balance" in make_result(baseline=found).assessment.reasons[0]


def test_grains_that_walls_carry_get_no_error_bars() -> None:
    result = make_result()
    found = balance.beside(Balance(replace(chute(), u=-chute().u)), result)
    assert found.carried
    made = balance.judged(result, found)
    assert made.theta == result.theta
    assert made.covariance is None
    assert made.error_bars is None
    assert made.parameters["mu_s"].interval_90 is None
    assert made.assessment.reasons[0].startswith("Walls carry the grains")
    assert made.law.reason == balance.CARRIED


def test_grains_on_their_base_keep_their_error_bars() -> None:
    result = make_result()
    made = balance.judged(result, balance.beside(Balance(chute()), result))
    assert made.error_bars == result.error_bars
    assert made.parameters == result.parameters


def test_the_error_bars_of_both_count() -> None:
    """sd(mu)/mu of the result is 3 % here: a difference counts less."""
    alone = balance.beside(Balance(chute()), result_with(1.05)).network[0]
    result = replace(result_with(1.05), covariance=make_result().covariance)
    both = balance.beside(Balance(chute()), result).network[0]
    assert alone.percent == both.percent
    assert both.se_percent > alone.se_percent


def test_a_failure_of_the_balance_is_not_one_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(flow: Flow, I0: float, side_walls: SideWalls | None) -> Baseline:
        raise RuntimeError("singular")

    monkeypatch.setattr(balance, "baseline", fail)

    class Seen:
        balance = Balance(chute())

    result = judgement._with_baseline(result_with(1.0), Seen())  # type: ignore[arg-type]
    assert [part.what for part in result.not_done] == [BASELINE]
    assert asked_for(result) == []
    assert result.baseline is None


def test_a_balance_ahead_is_made_once_with_the_same_record(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = []

    def counted(flow: Flow, I0: float, side_walls: SideWalls | None) -> Baseline:
        made.append(threading.current_thread())
        return baseline(flow, I0, side_walls)

    monkeypatch.setattr(balance, "baseline", counted)
    case = case_of(Balance(chute()), {"I0": 0.3})
    with threads(1) as beside:
        made_ahead([case], beside)
        found = balance.beside(case.balance, result_with(1.0))
    assert len(made) == 1
    assert made[0] is not threading.main_thread()
    assert found == balance.beside(Balance(chute()), result_with(1.0))


def test_a_balance_at_an_identified_scale_waits_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[object] = []
    monkeypatch.setattr(balance, "baseline", lambda *asked: made.append(asked))
    with threads(1) as beside:
        made_ahead([case_of(Balance(chute()), {})], beside)
    assert not made


def test_a_balance_ahead_that_fails_ends_as_one_in_its_place(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(flow: Flow, I0: float, side_walls: SideWalls | None) -> Baseline:
        raise RuntimeError("singular")

    monkeypatch.setattr(balance, "baseline", fail)
    case = case_of(Balance(chute()), {"I0": 0.3})
    with threads(1) as beside:
        made_ahead([case], beside)
    result = judgement._with_baseline(result_with(1.0), case)
    assert result.not_done == (NotDone(BASELINE, "RuntimeError: singular"),)


def test_a_flow_has_one_balance_for_each_inertial_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    """Members ask from several threads, as a batch on a GPU does."""
    made = []

    def counted(flow: Flow, I0: float, side_walls: SideWalls | None) -> Baseline:
        made.append(I0)
        return baseline(flow, I0, side_walls)

    monkeypatch.setattr(balance, "baseline", counted)
    shared = Balance(chute())
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(shared.at, [0.3, 0.3, 0.25, 0.3]))
    assert sorted(made) == [0.25, 0.3]
    assert found[0] is found[3]
    assert found[2] != found[0]


def test_where_it_does_not_apply_there_is_no_difference() -> None:
    found = balance.beside(Balance(replace(chute(), surface=None)), result_with(1.0))
    assert found.network == ()
    assert "it does not apply: the flow has no surface line" in str(found)
