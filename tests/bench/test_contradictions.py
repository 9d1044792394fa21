"""The table of contradictions: a case is right if the exit code and the words are."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bench.studies.reliability import contradictions
from bench.studies.reliability.contradictions import COLUMNS, Case, main, of_tables, outcome

(CUT,) = (case for case in of_tables() if case.name == "cut off")
VERDICTS: dict[str, tuple[dict[str, Any], str]] = {
    "right": ({}, "right"),
    "another code": ({"code": 0}, "wrong"),
    "other words": ({"said": "nobody says this"}, "wrong"),
    "words that must not be": ({"said": "not it was cut off here"}, "wrong"),
}


@pytest.mark.parametrize("name", VERDICTS)
def test_the_verdict(tmp_path: Path, name: str) -> None:
    changes, verdict = VERDICTS[name]
    case: Case = replace(CUT, **changes)
    row = outcome(case, tmp_path)
    assert (row["right"], row["exit code"]) == (verdict, 2)
    assert tuple(row) == COLUMNS
    assert str(tmp_path) not in str(row)


def test_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contradictions, "of_a_collapse", list)  # it takes a simulation
    out = tmp_path / "a.csv"
    assert main(["--only", "a comma in the numbers", "--out", str(out)]) == 0
    (row,) = csv.DictReader(out.read_text(encoding="utf-8").splitlines())
    assert row["said"].startswith("granpinn.convert: ")
