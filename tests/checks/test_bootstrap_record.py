"""The record of a bootstrap in results.json: exact to write and read, and strict."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from granpinn.checks.bootstrap import Bootstrap, Recovery
from granpinn.results import ResultsFileError, from_dict, read_results, write_results
from tests.examples import make_result

ROW = Recovery(0.41, 0.001, 0.0004, 0.0012, 0.0003, 0.0015, 0.0002, 0.012)
FULL = Bootstrap(
    None, 6, 1, 64, 4000, 1.25, 4.0, None, 12.5, {"mu_s": ROW, "mu_2": ROW}, (0.01, 0.2), (ROW, ROW)
)


@pytest.mark.parametrize("record", [FULL, Bootstrap("no scene")])
def test_what_is_written_comes_back(record: Bootstrap, tmp_path: Path) -> None:
    result = make_result(checks={"bootstrap": record})
    write_results(result, tmp_path / "results.json")
    assert read_results(tmp_path / "results.json") == result


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"flows": 1}, "flows must be at least 2, got 1"),
        ({"I": [0.01]}, "I and friction must have equally many values, got 1 and 2"),
        ({"spread": 1.0}, "checks.bootstrap.spread is not known"),
        ({"cells": 6.5}, "bootstrap.cells must be a whole number, got 6.5"),
    ],
)
def test_a_wrong_record_is_one_sentence(change: dict[str, Any], words: str) -> None:
    content = make_result(checks={"bootstrap": FULL}).to_dict()
    content["checks"]["bootstrap"] |= change
    with pytest.raises(ResultsFileError) as error:
        from_dict(content)
    assert words in str(error.value)
