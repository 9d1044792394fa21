"""What is made of a flow alone is made once, also when several threads ask at the same time."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from typing import Any

import numpy as np
import pytest

from granpinn.data import Flow
from granpinn.data.surface_sd import surface_sd
from granpinn.identification import of_flow
from granpinn.identification.of_flow import OfFlow
from granpinn.identification.once import Once
from granpinn.identification.scoring import strain_rate_of
from tests.flows import make_flow

THREADS = 4


def asked(what: Any, *arguments: Any) -> list[Any]:
    """The answers to threads that ask at the same time."""
    together = Barrier(THREADS)

    def ask(_: int) -> Any:
        together.wait()
        return what(*arguments)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(ask, range(THREADS)))


def test_each_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    def counted_sd(flow: Flow, level: str) -> float:
        made.append(level)
        return surface_sd(flow, level)

    def counted_rate(flow: Flow) -> Any:
        made.append("strain rate")
        return strain_rate_of(flow)

    monkeypatch.setattr(of_flow, "surface_sd", counted_sd)
    monkeypatch.setattr(of_flow, "strain_rate_of", counted_rate)
    flow = make_flow()
    once = OfFlow(flow)
    assert asked(once.surface_sd, "V1") == [surface_sd(flow, "V1")] * THREADS
    assert asked(once.surface_sd, "V0") == [surface_sd(flow, "V0")] * THREADS
    for found in asked(once.strain_rate):
        np.testing.assert_array_equal(found, strain_rate_of(flow))
    assert made == ["V1", "V0", "strain rate"]


def test_one_that_fails_is_made_again() -> None:
    asked: list[str] = []

    def make(key: str) -> str:
        asked.append(key)
        if len(asked) == 1:
            raise RuntimeError("no room")
        return key.upper()

    once = Once(make)
    with pytest.raises(RuntimeError, match="no room"):
        once("a")
    assert [once("a"), once("a"), once("b")] == ["A", "A", "B"]
    assert asked == ["a", "a", "b"]
