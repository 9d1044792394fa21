"""The study of verdicts: the error of halves, and the counts with its limits."""

from __future__ import annotations

from typing import Any

import pytest

from bench.studies.laws.verdict.calibrate import error_of, judged, limit_percent
from granpinn.results.parts import SPLITS


def row(kind: str, percent: float, residual: float = 0.1) -> dict[str, Any]:
    split = {"percent": percent, "residual_percent": residual}
    parts = [split | {"name": name} for name in SPLITS]
    return {"kind": kind, "noise": 0.02, "parts": parts, "verdict": {"follows": True, "words": ""}}


def entry(count: int = 40) -> Any:
    rows = [row("clean", 0.5 * (-1) ** k) for k in range(count)] + [row("time", 20.0)]
    return error_of(rows, (0.03, 0.12), 20_000, "a study")


def test_the_error_of_halves_is_what_residuals_do_not_show() -> None:
    found = entry()
    assert found.flows == 40
    assert found.sd["side"] == pytest.approx((0.5**2 - 0.1**2) ** 0.5 / 100)
    with pytest.raises(ValueError, match="no clean flow has a difference in time"):
        error_of([row("time", 1.0)], (0.0, 1.0), 1, "")


def test_flows_are_counted_with_the_limits_of_an_entry() -> None:
    found = entry()
    limit = limit_percent(row("clean", 0.0)["parts"][0], found, 4)
    assert 3 * 0.5 < limit < 4 * 0.5  # Scheffe's factor for two parameters
    assert judged(row("time", 1.01 * limit), found)["verdict"]["follows"] is False
    assert judged(row("time", 1.01 * limit), found)["named"]
    assert not judged(row("time", -1.01 * limit), found)["named"]
    assert judged(row("clean", 0.99 * limit), found)["verdict"]["follows"]
    assert limit_percent(row("clean", 0.0)["parts"][0], entry(8), 4) > limit
