"""Many runs as one table."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import pytest

from granpinn.commands import collect
from granpinn.results import write_results
from tests.examples import make_result


def rows_of(table: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """Two runs, one of them in a folder of its own, with a run inside that belongs to it."""
    made = make_result()
    for name, seed in (("a", 1), ("study/b", 2), ("study/b/profile", 3)):
        folder = tmp_path / name
        folder.mkdir(parents=True)
        write_results(dataclasses.replace(made, seed=seed), folder / "results.json")
    (tmp_path / "empty").mkdir()
    return tmp_path


def test_every_run_is_a_row(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = runs / "table.csv"
    assert collect.main([str(runs), str(runs / "a"), "--out", str(table)]) == 0
    rows = rows_of(table)
    assert [row["run"] for row in rows] == [str(runs / "a"), str(runs / "study/b")]
    assert [row["seed"] for row in rows] == ["1", "2"]
    parameter = make_result().parameters["mu_s"]
    assert float(rows[0]["mu_s"]) == parameter.value
    assert float(rows[0]["mu_s_std"]) == parameter.std
    assert rows[0]["assessment"]
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == (
        f"{runs / 'a'}: mu_of_i, mu = 0.440 (0.420 to 0.460) at I = 0.045; {rows[0]['assessment']}"
    )
    assert printed[-1] == f"2 runs: {table}"


def test_a_damaged_run_is_named_and_the_others_are_kept(
    runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (runs / "a" / "results.json").write_text("{")
    table = runs / "table.csv"
    assert collect.main([str(runs), "--out", str(table)]) == 1
    assert len(rows_of(table)) == 1
    assert str(runs / "a") in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["empty"], "has no finished run"),
        (["nowhere"], "is no folder"),
        (["a", "--out", "nowhere/table.csv"], "must lie in an existing folder"),
    ],
)
def test_bad_input_is_one_sentence(
    runs: Path,
    words: list[str],
    expected: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(runs)
    assert collect.main(words) == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    assert expected in sentence
