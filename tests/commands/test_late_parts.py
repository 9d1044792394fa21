"""A finished training is on disk before each later part begins, and each part fails alone."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from granpinn import identify, identify_many, load, results
from granpinn.checks import momentum_balance
from granpinn.data import Flow
from granpinn.figures import album, page
from granpinn.fit import case, prediction
from granpinn.fit.context import ASSUMPTIONS, CURVE, FIELDS
from granpinn.output import OutputError
from granpinn.results.record import PENDING, why_not_done
from granpinn.training.trainer import Trainer
from granpinn.uncertainty import error_bars, sensitivity
from tests.commands.late_parts import FILES, missing, raising, run
from tests.runs import tiny

BALANCE = "momentum_balance"
# The parts in their order, by what makes them: those that are not done when one begins.
PARTS: dict[str, tuple[Any, str, tuple[str, ...]]] = {
    "copies": (sensitivity, "continued", (CURVE, BALANCE, ASSUMPTIONS)),
    "fields": (prediction, "predict", (FIELDS, CURVE, BALANCE, ASSUMPTIONS)),
    "balance": (case, "baseline", (BALANCE,)),
}


def read(folder: Path) -> results.Result:
    return results.read_results(folder / "results.json")


@pytest.mark.parametrize("part", PARTS)
def test_everything_is_on_disk_when_a_part_begins(
    part: str, flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner, name, pending = PARTS[part]
    found: list[results.Result] = []
    real = getattr(owner, name)

    def look(*args: Any, **kwargs: Any) -> Any:
        if not found:
            if part == "balance":
                assert "p" in results.read_fields(tmp_path / "fields.h5").values
            if part != "fields":
                assert {path.name for path in tmp_path.iterdir()} >= FILES
            found.append(read(tmp_path))
        return real(*args, **kwargs)

    monkeypatch.setattr(owner, name, look)
    monkeypatch.setattr(error_bars, "untested", lambda config: [])
    last = identify(flow_file, tiny(steps=200), run_dir=tmp_path)
    (before,) = found
    assert missing(before) == dict.fromkeys(pending, PENDING)
    (line,) = before.assumptions
    if ASSUMPTIONS in pending:
        assert (line.derivative, line.why) == (None, PENDING)
        assert (before.error_bars, before.covariance) == (None, None)
    else:
        assert before.parameters == last.parameters
    assert before.theta == last.theta
    assert last.not_done == {}
    assert last.error_bars is not None
    assert last.error_bars.assumptions is not None
    assert read(tmp_path).to_dict() == last.to_dict()


FAILURES: list[tuple[Any, str, Exception, str, int]] = [
    (case, "baseline", MemoryError("Unable to allocate 31 GiB"), BALANCE, 0),
    (case, "baseline", RecursionError("deep\nand\x1b[2J long"), BALANCE, 0),
    (sensitivity, "continued", KeyError("a bug"), ASSUMPTIONS, 0),
    (prediction, "predict", MemoryError(), FIELDS, 1),
    (page, "build", RuntimeError("no page today"), "report", 0),
]


@pytest.mark.parametrize(("owner", "name", "error", "part", "code"), FAILURES)
@pytest.mark.usefixtures("no_report")
def test_a_part_fails_alone(
    owner: Any,
    name: str,
    error: Exception,
    part: str,
    code: int,
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without fields, which the user asked for, the command ends with code 1."""
    monkeypatch.setattr(owner, name, raising(error))
    assert run(flow_file, "--out", tmp_path / "run") == code
    result = read(tmp_path / "run")
    (why,) = (text for name, text in missing(result).items() if name == part)
    assert why.isprintable()
    said = capsys.readouterr()
    line = f"no {part.replace('_', ' ')}: {why}"
    if code:
        last = f"granpinn.train: {line}; the other results are valid"
        assert said.err.splitlines()[-1] == last
    else:
        assert line in said.out + result.summary()
        assert {path.name for path in (tmp_path / "run").iterdir()} >= FILES
    assert result.parameters.mu_s.value > 0
    assert result.residuals is not None
    assert (BALANCE in result.checks) == (part != BALANCE)


def in_the_copies(trainer: Trainer, real: Any = sensitivity.Trainer.advance) -> None:
    real(trainer)
    if len(trainer.params) == 2:
        os.kill(os.getpid(), signal.SIGINT)


def in_the_balance(*args: Any, **kwargs: Any) -> Any:
    os.kill(os.getpid(), signal.SIGTERM)


SIGNALS: dict[str, tuple[Any, str, Any, int]] = {
    "copies": (sensitivity.Trainer, "advance", in_the_copies, 130),
    "balance": (case, "baseline", in_the_balance, 143),
}


@pytest.mark.parametrize("part", SIGNALS)
@pytest.mark.usefixtures("no_report")
def test_a_signal_stops_and_resume_makes_the_rest(
    part: str, flow_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(flow_file, "--out", tmp_path / "whole") == 0
    owner, name, signalled, code = SIGNALS[part]
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, signalled)
        assert run(flow_file, "--out", tmp_path / "run") == code
    left = read(tmp_path / "run")
    assert missing(left) == dict.fromkeys(PARTS[part][2], PENDING)
    if part == "copies":
        assert "its effect is not known: the run ended before it; --resume" in left.summary()
    assert run("--out", tmp_path / "run", "--resume") == 0
    whole, resumed = read(tmp_path / "whole"), read(tmp_path / "run")
    assert resumed.not_done == {}
    assert resumed.theta == left.theta
    assert resumed.parameters == whole.parameters
    assert resumed.assumptions == whole.assumptions
    assert resumed.error_percent == whole.error_percent


def test_a_member_of_a_batch_fails_alone(
    flow: Flow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = momentum_balance.undetermined
    begun = []

    def second_fails(seen: Flow, level: Any) -> Any:
        written = [(tmp_path / f"{e:03d}" / "results.json").exists() for e in range(3)]
        assert all(written)  # of all members, before the first check
        begun.append(seen)
        if len(begun) == 2:
            raise MemoryError
        return real(seen, level)

    monkeypatch.setattr(momentum_balance, "undetermined", second_fails)
    found = identify_many([flow] * 3, tiny(), [0, 1, 2], run_dir=tmp_path)
    why = {BALANCE: "there is not enough memory"}
    assert [missing(result) for result in found] == [{}, why, {}]
    for e, result in enumerate(found):
        assert read(tmp_path / f"{e:03d}").to_dict() == result.to_dict()


def test_a_disk_that_is_full_is_no_missing_part() -> None:
    with pytest.raises(OutputError, match="no room"):
        why_not_done(OutputError("no room"))
    assert why_not_done(KeyError("a bug")) == "KeyError: 'a bug'"


def test_a_figure_fails_alone(
    flow_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    figures: Callable[..., None],
) -> None:
    figures("velocity", "evolution")
    error = RecursionError("deep\nand\x1b[2J long")
    title, _ = album.FIGURES["velocity"]
    monkeypatch.setitem(album.FIGURES, "velocity", (title, raising(error)))
    assert run(flow_file, "--out", tmp_path / "run") == 0
    text = (tmp_path / "run" / "report.html").read_text()
    assert f"<li>{title}: " in text
    assert not (tmp_path / "run" / "figures" / "velocity.png").exists()
    assert (tmp_path / "run" / "figures" / "evolution.png").exists()


def test_the_answer_comes_before_the_figures_which_may_fail(
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    printed = []

    def fails(*args: object, **kwargs: object) -> Path:
        printed.append(capsys.readouterr().out)
        raise ValueError("no font")

    monkeypatch.setattr(page, "build", fails)
    assert run(flow_file, "--out", tmp_path / "run") == 0
    assert printed[0].startswith("mu_s")
    assert capsys.readouterr().out == "report: not done: ValueError: no font\n"
    assert missing(read(tmp_path / "run"))["report"] == "ValueError: no font"


def test_a_page_names_what_was_not_done(
    flow_file: Path, tmp_path: Path, figures: Callable[..., None]
) -> None:
    figures()
    result = identify(flow_file, tiny(steps=3), run_dir=tmp_path)
    results.write_results(result.without("unknown_I0", "a <b> reason"), tmp_path / "results.json")
    text = load(tmp_path).report().read_text()
    assert "<li>Unknown i0: a &lt;b&gt; reason</li>" in text


@pytest.mark.usefixtures("no_report")
def test_a_folder_that_vanishes_is_an_error(
    flow_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "run"

    def removed(*args: object, **kwargs: object) -> Path:
        shutil.rmtree(folder)
        folder.mkdir()
        return folder / "report.html"

    monkeypatch.setattr(page, "build", removed)
    assert run(flow_file, "--out", folder) == 1
    err = capsys.readouterr().err.splitlines()[-1]
    assert err.startswith(f"granpinn.train: {folder} was removed during the run")
