"""Every setting has bounds, and a training at each of them ends in numbers or in a sentence."""

from __future__ import annotations

import math
from typing import Any

import pytest

from granpinn.config import Config, ConfigError, settings_of
from granpinn.config.fields import Setting, without_none
from granpinn.data import Flow
from granpinn.errors import CannotGoOn
from tests.flows import make_flow
from tests.runs import make_run, tiny

NUMBERS = {
    key: stated
    for key, stated in settings_of(Config).items()
    if without_none(stated.kind)[0] in (int, float, tuple[int, ...], tuple[float, ...])
}
# Of these the memory or the time of a run limits the use.
COSTLY = ("members", "batch.interior", "batch.surface", "steps", "epochs", "max_time", "network")


def bounds(stated: Setting) -> tuple[float, float]:
    return stated.low, stated.high


def as_value(stated: Setting, number: float) -> Any:
    kind, _ = without_none(stated.kind)
    return (number, number) if kind in (tuple[int, ...], tuple[float, ...]) else number


@pytest.mark.parametrize("key", NUMBERS)
def test_every_number_has_bounds_that_its_type_holds(key: str) -> None:
    low, high = bounds(NUMBERS[key])
    assert -1e30 <= low < high
    if key.startswith("weights.sigma_"):
        assert high == math.inf  # it leaves a term out
        return
    assert high <= 1e30
    if int in (NUMBERS[key].kind, without_none(NUMBERS[key].kind)[0]):
        assert isinstance(NUMBERS[key].high, int)
        assert high <= (2**63 - 1 if key == "seed" else 2**53)


@pytest.mark.parametrize("key", NUMBERS)
def test_a_number_beyond_its_bounds_is_refused(key: str) -> None:
    stated = NUMBERS[key]
    low, high = bounds(stated)
    whole = isinstance(stated.high, int)
    wrong = [low - 1, -(2**63), -(10**300)]
    wrong += [] if math.isinf(high) else [high + 1 if whole else math.nextafter(high, math.inf)]
    wrong += [] if whole or math.isinf(high) else [math.inf, math.nan]
    for number in wrong:
        value = as_value(stated, number)
        with pytest.raises(ConfigError, match=rf"^{key} must be ") as refusal:
            Config(**{key: value})
        assert "\n" not in str(refusal.value)


@pytest.fixture(scope="module")
def flow() -> Flow:
    return make_flow(frames=4, rows=12, columns=10)


@pytest.mark.parametrize("key", [k for k in NUMBERS if not k.startswith(COSTLY)])
@pytest.mark.parametrize("end", [0, 1])
def test_a_training_at_a_bound_ends_in_numbers_or_a_sentence(
    key: str, end: int, flow: Flow
) -> None:
    value = bounds(NUMBERS[key])[end]
    run = make_run(tiny(**{"steps": 5, "optimizer.last_layer": False, key: value}), flow)
    stopped = None
    try:
        run.train()
    except CannotGoOn as error:
        stopped = str(error)
    assert "became NaN or infinite" in stopped if stopped else run.trainer.params.isfinite().all()
