"""Learning rate and stages as functions of the step."""

from __future__ import annotations

from typing import Any

import pytest

from granpinn.config import Optimizer
from granpinn.training.schedule import Schedule


def schedule(total: int = 1000, **changes: Any) -> Schedule:
    settings = {"warm_up": 0.0, "prefit": 0.0} | changes
    return Schedule(total, Optimizer(**settings))


def test_the_learning_rate_falls_from_its_peak_to_its_end() -> None:
    s = schedule(final_fraction=0.01)
    assert s.learning_rate(0) == 1
    assert s.learning_rate(500) == pytest.approx(0.505)
    assert s.learning_rate(1000) == pytest.approx(0.01)
    rates = [s.learning_rate(step) for step in range(1000)]
    assert rates == sorted(rates, reverse=True)


def test_each_stage_warms_up_and_decays() -> None:
    s = schedule(prefit=0.4, warm_up=0.05)
    assert [step for step in range(1000) if s.ends_prefit(step)] == [400]
    assert s.in_prefit(399)
    assert not s.in_prefit(400)
    assert s.learning_rate(0) == pytest.approx(1 / 20)
    assert s.learning_rate(20) == 1
    assert s.learning_rate(399) == pytest.approx(0.1, abs=0.01)
    assert s.learning_rate(400) == pytest.approx(1 / 30)
    assert s.learning_rate(430) == 1
    assert s.learning_rate(999) == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("total", [600, 5000])
def test_a_new_schedule_goes_on_without_a_jump_and_ends_at_the_end(total: int) -> None:
    s = schedule(prefit=0.2, warm_up=0.05)
    new = s.ending_at(total, step=500)
    assert new.progress(500) == s.progress(500)
    assert new.learning_rate(500) == pytest.approx(s.learning_rate(500))
    assert new.progress(total) == 1
    assert new.learning_rate(total) == pytest.approx(0)
    assert not new.in_prefit(500)
