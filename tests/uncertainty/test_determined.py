"""What a narrow range of inertial numbers determines."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from granpinn.results import Parameters, read_results, write_results
from granpinn.results.result import Result
from granpinn.uncertainty.determined import applied, determined
from tests.examples import make_result


def found_in(low: float, high: float, result: Result) -> tuple[str, ...]:
    return tuple(determined(result, [(low, high)]))


@pytest.mark.parametrize(
    ("low", "high", "lost"),
    [
        (0.004, 0.3, ()),  # a collapse
        (0.005, 0.2, ()),
        (0.1, 0.13, ("mu_s", "mu_2")),  # a steady chute
        (0.005, 0.02, ("mu_2",)),  # creep
    ],
)
def test_the_range_decides(low: float, high: float, lost: tuple[str, ...]) -> None:
    assert found_in(low, high, make_result()) == lost
    assert found_in(low, high, make_result(covariance=None)) == lost


def test_a_wide_interval_determines_nothing() -> None:
    result = make_result()
    values = dict(result.parameters.items())
    values["mu_2"] = replace(values["mu_2"], interval_90=(1e-5, 7e3))
    wide = replace(result, parameters=Parameters(values))
    found = determined(wide, [(0.004, 0.3)])
    shown = applied(wide, found)
    assert shown.parameters["mu_2"].std is None
    (line,) = [text for text in str(shown).splitlines() if text.startswith("mu_2")]
    assert "not determined" in line
    assert line.endswith("its 90 % interval spans a factor of 7e+08")
    assert "mu_2 not determined: its 90 % interval spans" in shown.summary()
    content = shown.to_dict()
    assert content["parameters"]["mu_2"]["undetermined"] == found["mu_2"]
    assert content["parameters"]["mu_2"]["interval_90"] == [1e-5, 7e3]


def test_the_same_words_everywhere(tmp_path: Path) -> None:
    result = make_result()
    found = determined(result, [(0.1, 0.14)])
    made = applied(result, found)
    assert made.theta == result.theta  # nothing is lost
    lines = made.summary().splitlines()
    assert "not determined" in lines[1]
    assert "0.4100" not in lines[1]
    assert any(line.startswith("mu_s and mu_2 not determined: ") for line in lines)
    write_results(made, tmp_path / "results.json")
    content = json.loads((tmp_path / "results.json").read_text())["parameters"]["mu_s"]
    assert (content["value"], content["undetermined"]) == (0.41, found["mu_s"])
    assert read_results(tmp_path / "results.json") == made
    assert "not determined" in str(made)
