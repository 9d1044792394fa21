"""The comparison of laws as a part of an identification."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from granpinn import identify, results
from granpinn.data import Flow
from granpinn.fit import free_curve
from granpinn.physics.laws import LAWS
from granpinn.results import Result
from tests.runs import tiny

NAME = "comparison_of_laws"


NAMES = {"coulomb", "mu_of_i", "regularised", "power", "cohesive", "free"}


SETTINGS = {"compare_laws": True}


@pytest.fixture(autouse=True)
def calibrated(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if tiny networks were those of the default recipe."""
    monkeypatch.setattr(free_curve, "untested", lambda config: [])
    monkeypatch.setattr(free_curve, "LARGEST", math.inf)


def sound(result: Result) -> None:
    assert NAME not in result.not_done
    record = result.checks[NAME]
    assert {c.law for c in record.laws} == NAMES
    assert [c.verdict for c in record.laws].count("chosen") == 1
    for c in record.laws:
        assert set(c.parameters) == set(LAWS[c.law].names)


def test_a_run_says_which_laws_explain_the_data(flow: Flow, tmp_path: Path) -> None:
    result = identify(flow, tiny(free_I0=True, **SETTINGS), run_dir=tmp_path)
    sound(result)
    record = result.checks[NAME]
    content = json.loads((tmp_path / "results.json").read_text())["checks"][NAME]
    assert content["laws"][0]["law"] == record.laws[0].law
    assert set(content["laws"][0]) == {"law", "verdict", "parameters"}
    assert results.read_results(tmp_path / "results.json").checks == result.checks
    lines = result.summary().splitlines()
    assert any(line.split()[:2] == [record.laws[0].law, "chosen"] for line in lines)
    assert any("explain" in line for line in lines)


def test_a_comparison_that_cannot_be_made_is_said(
    flow: Flow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(free_curve, "untested", lambda config: ["network.widths"])
    result = identify(flow, tiny(**SETTINGS))
    assert result.not_done[NAME].endswith("this run has another network.widths")
    assert NAME not in result.checks
    monkeypatch.setattr(free_curve, "untested", lambda config: [])
    monkeypatch.setattr(free_curve, "LARGEST", 1.0)
    short = identify(flow, tiny(**SETTINGS))
    assert short.not_done[NAME].startswith("so few steps")
    strong = identify(flow, tiny(form="strong", **SETTINGS))
    assert list(strong.not_done) == [NAME]


def test_it_survives_a_resumption(flow_file: Path, tmp_path: Path) -> None:
    first = identify(flow_file, tiny(steps=20, **SETTINGS), run_dir=tmp_path)
    again = identify(flow_file, tiny(steps=20, resume=True, **SETTINGS), run_dir=tmp_path)
    assert again.checks == first.checks
