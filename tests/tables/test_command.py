"""The command: its files, its errors, and the reuse of simulated flows."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from granpinn.commands.tables import main
from granpinn.data import Truth, read_flow, write_flow
from granpinn.results import read_results
from granpinn.tables import flows
from tests.flows import make_flow
from tests.page import Page

TOML = """
log_every = 10
[network]
widths = [6, 5]
[batch]
interior = 16
surface = 4
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two flows with the parameters of the paper's cases."""
    folder = tmp_path_factory.mktemp("cases")
    for name, truth in (("a", Truth(0.4, 0.64, 0.3)), ("b<b>", Truth(0.6, 0.84, 0.25))):
        write_flow(make_flow(rows=12, columns=10, truth=truth), folder / f"{name}.h5")
    (folder / "notes.txt").write_text("no flow")
    (folder / "settings.toml").write_text(TOML)
    return folder


@pytest.fixture(scope="module")
def out(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output of the command on both."""
    out = tmp_path_factory.mktemp("tables") / "out"
    argv = [folder, "--out", out, "--noise", 0, 0.2, "--seeds", 2, "--steps", 20]
    argv += ["--config", folder / "settings.toml"]
    assert main([str(a) for a in argv]) == 0
    return out


def rows_of(out: Path) -> list[dict[str, str]]:
    with (out / "tables.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_csv_has_a_line_for_every_training(out: Path) -> None:
    rows = rows_of(out)
    assert [(r["case"], r["noise"], r["I0"], r["seed"]) for r in rows] == [
        *(("(0.40, 0.64)", "0.0", "0.3", seed) for seed in "01"),
        *(("(0.60, 0.84)", noise, "0.25", seed) for noise in ("0.0", "0.2") for seed in "01"),
    ]
    assert {r["failure"] for r in rows} == {""}
    for k, row in enumerate(rows):
        result = read_results(out / "runs" / f"{k:03d}" / "results.json")
        assert float(row["mu_s"]) == result.parameters.mu_s.value
        assert result.settings["simulated_pressure"]["frames"] == 10
        errors = result.error_percent
        assert float(row["error_pressure_simulated"]) == errors.pressure_simulated
    assert not (out / "runs" / "005" / "fields.h5").exists()


def test_the_page_stands_alone(out: Path) -> None:
    html = (out / "tables.html").read_text(encoding="utf-8")
    page = Page(html)
    assert not {"script", "link", "iframe", "object", "base", "form", "a"} & set(page.tags)
    assert not re.search("https?:|url\\(|@import", html)
    assert "Table 2: identification with noise" in page.text
    assert "at rest simulated velocity" in page.text
    assert "(0.60, 0.84) 0.20" in page.text
    assert "13.4" not in page.text  # 80 % was not asked for
    assert "1.24" in page.text


def test_the_terminal_shows_both(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["--config", str(folder / "settings.toml"), "--steps", "20", "--seeds", "1"]
    assert main([str(folder / "a.h5"), "--out", str(tmp_path / "o"), *settings]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"^\(0\.40, 0\.64\) +0\.00 +0\.\d{4}", shown, re.MULTILINE)
    assert "Table 2" not in shown
    assert re.search(r"flowing +at rest +simulated +velocity +scatter % +seeds$", shown, re.M)
    assert "1 trainings of 20 steps as one batch on cpu" in shown


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        ([], "--out, the folder of the tables, is missing"),
        (["--out", "o", "--noise", "0.2", "0.2"], "levels that differ, got 0.2 0.2"),
        (["--out", "o", "--level", "V1", "V1"], "--level must be levels that differ, got V1 V1"),
        (["flow.h5", "--out", "o", "--stride", "2"], "--stride is for simulated flows"),
        (["--out", "o", "--cells", "100"], "cells must be a multiple of 8"),
        (["nowhere.h5", "--out", "o"], "nowhere.h5"),
        (["--out", "o", "--bogus"], "unrecognized arguments: --bogus"),
    ],
)
def test_nonsense_is_refused_in_one_sentence(
    argv: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.startswith("granpinn.tables: ")
    assert err.count("\n") == 1


def test_every_level_is_a_batch_and_a_table(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = [str(folder / "a.h5"), "--out", str(tmp_path), "--level", "V2", "V0", "--seeds", "2"]
    assert main([*argv, "--steps", "20", "--config", str(folder / "settings.toml")]) == 0
    rows = rows_of(tmp_path)
    assert [row["level"] for row in rows] == ["V0", "V0", "V2", "V2"]
    assert rows[0]["mu_s"] != rows[2]["mu_s"]
    assert (tmp_path / "runs" / "V2" / "001" / "results.json").exists()
    shown = capsys.readouterr().out
    assert "Table 1: identification without noise, level V2" in shown
    assert "4 trainings of 20 steps as 2 batches" in shown
    page = Page((tmp_path / "tables.html").read_text(encoding="utf-8"))
    assert page.text.count("53 % in mu_s") == 1


def test_simulated_flows_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flows, "PAPER_CASES", ((0.2, 0.32), (0.6, 0.84)))
    said: list[str] = []
    first = flows.six_regimes(tmp_path, 64, 2, said.append)
    assert [f.truth and f.truth.mu_2 for f in first] == [0.32, 0.84]
    assert any("simulated collapse_0.20_0.32.h5" in text for text in said)
    said.clear()
    (tmp_path / "collapse_0.60_0.84.h5").unlink()
    write_flow(make_flow(), tmp_path / "collapse_0.60_0.84.h5")  # not what belongs there
    again = flows.six_regimes(tmp_path, 64, 2, said.append)
    assert not any("0.20_0.32" in text for text in said)
    np.testing.assert_array_equal(again[1].u, first[1].u)
    assert read_flow(tmp_path / "collapse_0.60_0.84.h5").attributes["stride"] == 2
