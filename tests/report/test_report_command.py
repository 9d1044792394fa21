"""Building a report from a run folder: missing files, old files, and exit codes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from granpinn import load
from granpinn.commands.report import main
from granpinn.figures import album, curves, page
from granpinn.figures.style import Drawing, new_figure
from granpinn.physics.laws import DEFAULT
from granpinn.results import write_results
from granpinn.training.history import HistoryFileError, columns, read_history
from tests.examples import make_result
from tests.page import Page

COLUMNS = columns(DEFAULT)


HEADER = ",".join(COLUMNS) + "\n"


ROW = ",".join(map(str, range(1, 13))) + "\n"


@pytest.fixture(autouse=True)
def two_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two that need fields.h5 and one that needs history.csv, empty: drawing takes time."""
    two = {name: album.FIGURES[name] for name in ("friction_law", "evolution")}
    monkeypatch.setattr(album, "FIGURES", two)
    for name in two:
        monkeypatch.setattr(curves, name, lambda *_: Drawing(new_figure(1.0), "Empty."))


def build(folder: Path) -> Page:
    path = load(folder).report()
    assert path == folder / "report.html"
    return Page(path.read_text(encoding="utf-8"))


def test_a_folder_with_results_alone_gives_a_page(tmp_path: Path) -> None:
    write_results(make_result(truth=None), tmp_path / "results.json")
    page = build(tmp_path)
    assert "img" not in page.tags
    assert f"Friction law: {tmp_path / 'fields.h5'} does not exist" in page.text
    assert "script" not in page.tags
    assert "Course of the training: history.csv does not exist" in page.text
    assert "μs 0.410 ± 0.012" in page.text


def test_a_run_is_read_and_drawn_without_torch(run_dir: Path) -> None:
    assert "momentum_balance" in load(run_dir).checks
    code = (
        "import sys, granpinn; result = granpinn.load(sys.argv[1]); print(result.export('json'))\n"
        "result.report(); assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code, str(run_dir)], check=True)
    assert (run_dir / "report.html").exists()


def test_damaged_fields_are_said_and_their_old_figures_removed(run_dir: Path) -> None:
    assert build(run_dir).tags.count("img") == 2
    content = (run_dir / "fields.h5").read_bytes()
    (run_dir / "fields.h5").write_bytes(content[: len(content) // 2])
    page = build(run_dir)
    assert page.values("img", "alt") == ["Course of the training"]
    assert "fields.h5 could not be read as granpinn-fields" in page.text
    left = {path.name for path in (run_dir / "figures").iterdir()}
    assert left == {"evolution.png"}


def test_a_damaged_history_is_said(run_dir: Path) -> None:
    (run_dir / "history.csv").write_bytes(b"\xff\xfe\n")
    page = build(run_dir)
    assert page.values("img", "alt") == ["Friction law"]
    assert "history.csv could not be read: 'utf-8' codec" in page.text


def test_building_again_gives_the_same_bytes(run_dir: Path) -> None:
    load(run_dir).report()
    first = (run_dir / "report.html").read_bytes()
    (run_dir / "report.html").write_text("something else")
    load(run_dir).report()
    assert (run_dir / "report.html").read_bytes() == first


def test_a_page_that_fails_leaves_the_old_one(
    run_dir: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (run_dir / "report.html").write_text("the old page")
    before = {path.name for path in run_dir.iterdir()} | {"figures"}
    monkeypatch.setattr(page, "render", lambda *_: str(1 // 0))
    with pytest.raises(ZeroDivisionError):
        load(run_dir).report()
    assert (run_dir / "report.html").read_text() == "the old page"
    assert {path.name for path in run_dir.iterdir()} == before


def test_the_command_prints_the_page(
    run_dir: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    times: list[float | None] = []
    empty = Drawing(new_figure(1.0), "Empty.")
    noted = ("Course of the training", lambda run, time: times.append(time) or empty)
    monkeypatch.setattr(album, "FIGURES", {"evolution": noted})
    assert main([str(run_dir), "--time", "0.3"]) == 0
    assert capsys.readouterr() == (f"{run_dir / 'report.html'}\n", "")
    assert times == [0.3]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "results.json does not exist: give the folder of a finished run"),
        ('{"format_name": "granpinn-results", ', "could not be read as strict JSON"),
        ('{"format_name": "granpinn-results", "format_version": 6}', "parameters is missing"),
    ],
)
def test_a_folder_without_a_valid_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None, words: str
) -> None:
    if content is not None:
        (tmp_path / "results.json").write_text(content)
    assert_refused(capsys, main([str(tmp_path)]), 2, words)
    assert not (tmp_path / "report.html").exists()


def assert_refused(
    capsys: pytest.CaptureFixture[str], code: int, expected: int, words: str
) -> None:
    out, err = capsys.readouterr()
    assert (code, out) == (expected, "")
    assert err.startswith("granpinn.report: ")
    assert words in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("end", ["13,14", ROW[:-1], "2,3,4e-", "2,3,,,,,,,,,,"])
def test_a_last_line_without_its_end_is_left_out(tmp_path: Path, end: str) -> None:
    (tmp_path / "history.csv").write_text(HEADER + ROW + end)
    history = read_history(tmp_path / "history.csv")
    assert list(history) == list(COLUMNS)
    assert {name: column.tolist() for name, column in history.items()} == {
        name: [i] for i, name in enumerate(COLUMNS, start=1)
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "it should have the columns step, wall_s"),
        (HEADER[:-1], "it should have the columns"),
        ("step,loss\n1,2\n", "it should have the columns"),
        (HEADER + "1\n" + ROW, "it should have the columns"),
        (HEADER + ROW.strip() + "," + ROW, "it should have the columns"),
        (HEADER + ROW.replace("5", "five"), "could not convert string to float: 'five'"),
        (HEADER + ROW.replace("1,", ",", 1), "it should have a step in every line"),
        (HEADER + ROW.replace("1,", "inf,", 1), "it should have a step in every line"),
    ],
)
def test_what_is_no_history(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "history.csv").write_text(text)
    with pytest.raises(HistoryFileError) as caught:
        read_history(tmp_path / "history.csv")
    assert words in str(caught.value)
