"""results.json: exact to write and read, strict JSON, and errors of one sentence."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import pytest
import torch

from granpinn.results import (
    ErrorPercent,
    Parameter,
    Parameters,
    Result,
    ResultsFileError,
    Timing,
    read_results,
    write_results,
)
from granpinn.results.decoding import plain
from granpinn.results.records import Assumed
from tests.examples import LAW, PARAMETERS, SPARSE, make_result, residuals_with


def strict(path: Path) -> Any:
    """Parse JSON as other languages do: no NaN, no Infinity."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.mark.parametrize("result", [make_result(), make_result(**SPARSE)], ids=["full", "sparse"])
def test_what_is_written_comes_back(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    write_results(result, path)
    assert read_results(path) == read_results(str(path)) == result
    write_results(read_results(path), tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_the_file_says_what_it_is_and_keeps_every_digit(tmp_path: Path) -> None:
    write_results(make_result(), tmp_path / "results.json")
    content = strict(tmp_path / "results.json")
    assert list(content)[:2] == ["format_name", "format_version"]
    assert (content["format_name"], content["format_version"]) == ("granpinn-results", 6)
    assert content["parameters"]["mu_s"] == {
        "value": 0.41,
        "fixed": False,
        "std": 0.012,
        "interval_90": [0.39, 0.43],
        "undetermined": None,
    }
    assert content["timing"]["wall_s"] == 1 / 3
    assert content["error_percent"]["pressure_stagnant"] is None
    assert content["input"]["name"] == "Säule µ.h5"
    assert (tmp_path / "results.json").read_text(encoding="utf-8").endswith("}\n")


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_number_that_means_nothing_is_null(bad: float, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    result = make_result(
        error_percent=ErrorPercent(velocity=bad, pressure=1.0),
        settings={"sigma": bad, "nested": [{"limits": (0, np.float32(bad))}]},
    )
    write_results(result, path)
    content = strict(path)
    assert content["error_percent"]["velocity"] is None
    assert content["settings"] == {"sigma": None, "nested": [{"limits": [0, None]}]}
    back = read_results(path)
    assert back.error_percent == ErrorPercent(pressure=1.0)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"parameters": Parameters(PARAMETERS | {"mu_s": Parameter(math.nan, fixed=False)})},
            "the result: parameters.mu_s.value must be a number, got None",
        ),
        ({"timing": Timing(math.inf, 1)}, "timing.wall_s must be"),
        ({"seed": 1.5}, "the result: seed must be a whole number, got 1.5"),
    ],
)
def test_what_cannot_be_read_is_not_written(
    changes: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / "results.json"
    path.write_text("old")
    with pytest.raises(ResultsFileError, match=sentence):
        write_results(make_result(**changes), path)
    assert path.read_text() == "old"


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (np.float32(0.5), 0.5),
        (np.int64(3), 3),
        (np.bool_(True), True),
        (np.array([[1.0, np.nan]]), [[1.0, None]]),
        (torch.tensor(2.5), 2.5),
        (torch.tensor([1, 2]), [1, 2]),
        (torch.tensor([0.5], requires_grad=True), [0.5]),
        (PurePosixPath("runs/a"), "runs/a"),
        ((1, (2, "b")), [1, [2, "b"]]),
        ({1: None, "a": True}, {"1": None, "a": True}),
    ],
    ids=repr,
)
def test_plain_values(value: Any, expected: Any) -> None:
    found = plain(value)
    assert found == expected
    assert type(found) is type(expected)


def test_the_answer_is_a_few_lines() -> None:
    assert str(make_result()).splitlines() == [
        "mu_s    0.410  (0.390 to 0.430)   true 0.400   90 % intervals",
        "mu_2    0.610                     true 0.640   extrapolated: the flow reaches 0.67 I0",
        "I0      0.300                     true 0.300   given",
        "mu(I)   0.420 +- 0.020 at I = 0.01 to 0.490 +- 0.030 at I = 0.2",
        "GOOD    the equations hold; the momentum balance without a network agrees; "
        "the velocity fits the vectors to 0.4 %",
    ]


def test_the_answer_says_why_it_is_not_good() -> None:
    assert LAW.curve is not None
    law = replace(LAW, curve=replace(LAW.curve, low=None, high=None), reason="walls carry")
    lost = Parameters(PARAMETERS | {"mu_2": Parameter(7.0, fixed=False, undetermined="x")})
    changes = {"law": law, "parameters": lost, "residuals": residuals_with(0.1, 0.09, 0.2)}
    lines = str(make_result(**changes, timing=Timing(1.0, 500))).splitlines()
    assert lines[1].startswith("mu_2    not determined  ")
    assert lines[3] == (
        "mu(I)   0.420 at I = 0.01 to 0.490 at I = 0.2; the error is not known: walls carry"
    )
    assert lines[4] == (
        "DO NOT USE    The training has not settled: the forces of the fit are out of balance by "
        "0.2 of the weight of the grains. Train longer: about 4,000 steps in place of 500"
    )


def test_the_summary_is_a_table() -> None:
    assert make_result().summary().splitlines() == [
        "                     value     std     90 % interval    true  error %",
        "mu_s                0.4100  0.0120  0.3900 to 0.4300  0.4000     2.50",
        "mu_2                0.6100       -                 -  0.6400     4.69",
        "I0                  0.3000   given                 -  0.3000        -",
        "velocity                                                         0.80",
        "pressure                                                         4.00",
        "pressure, flowing                                                   -",
        "pressure, stagnant                                                  -",
        "mu(I) = 0.420 (0.400 to 0.440) at I = 0.01 to 0.490 (0.460 to 0.520) at I = 0.2",
        "momentum balance, no network: mu = 0.410 +- 0.010 at I = 0.01, "
        "0.430 +- 0.010 at I = 0.05, 0.500 +- 0.010 at I = 0.2; "
        "the network's law differs by +1.5 +- 2.5 % at I = 0.05",
        "assessment: good to use: mu(I) is known to +- 6.1 %: 0.420 (0.400 to 0.440) at I = 0.01 "
        "to 0.490 (0.460 to 0.520) at I = 0.2 (90 % intervals).",
    ]


def test_assumptions_are_kept_and_shown(tmp_path: Path) -> None:
    known = Assumed(
        *("surface line", "m", 0.005, "surface line one grain higher"),
        *({"mu_s": 0.4, "mu_2": -1.6}, {"mu_s": 0.5, "mu_2": -1.3}),
    )
    lost = Assumed("wall friction", "1", 0.05, "wall friction 0.05 higher", why="it diverged")
    result = make_result(assumptions=(known, lost))
    write_results(result, tmp_path / "results.json")
    assert read_results(tmp_path / "results.json") == result
    lines = result.summary().splitlines()
    assert (
        "surface line one grain higher: mu_s +0.5 %, mu_2 -1.3 % (surface line known to 0.005 m)"
        in lines
    )
    assert "wall friction (known to 0.05): its effect is not known: it diverged" in lines
