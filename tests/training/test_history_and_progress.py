"""history.csv, and the progress that a run shows."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from granpinn.data import Flow
from granpinn.physics.laws import DEFAULT
from granpinn.physics.terms import NAMES
from granpinn.progress import Bar
from granpinn.training.history import History, Row, columns, described, read_history, row_of
from tests.runs import make_run, tiny

NAN = math.nan


COLUMNS = columns(DEFAULT)


def row(step: int, **changes: float) -> Row:
    values = dict.fromkeys(COLUMNS[1:], 0.1 + 1e-17 * step) | {"mu_s": 0.4, "mu_2": 0.6} | changes
    return row_of(DEFAULT, [step, *values.values()])


def test_rows_come_back_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    history = History(path, DEFAULT)
    history.begin()
    rows = [row(1, loss=1 / 3), row(2, loss=1e-300, momentum=NAN), row(3)]
    for r in rows:
        history.append(r)
    history.close()
    written = path.read_text()
    path.write_text("something else")
    again = History(path, DEFAULT)
    again.begin(row_of(DEFAULT, values) for values in history.table.tolist())
    assert repr(again.rows) == repr(rows)
    assert path.read_text() == written
    again.append(row(4))
    again.close()
    lines = path.read_text().splitlines()
    assert lines[0] == ",".join(COLUMNS)
    assert len(lines) == 5
    assert ",," in lines[2]
    assert "nan" not in path.read_text()
    assert [*read_history(path)["loss"]] == [r["loss"] for r in again.rows]


def test_a_disk_that_fails_is_reported_with_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "history.csv"
    history = History(path, DEFAULT)
    history.begin()

    def fail(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(OSError, match="history.csv could not be written .No space left on device"):
        history.flush()
    history.close()


def test_a_run_writes_the_columns_of_its_stages(flow: Flow, tmp_path: Path) -> None:
    run = make_run(tiny(weights__follow_noise=False), flow, tmp_path / "run")
    run.train()
    prefit, whole = run.histories[0].rows[0], run.histories[0].rows[-1]
    assert math.isnan(prefit["momentum"])
    assert math.isfinite(prefit["velocity"])
    assert all(math.isfinite(value) for value in whole.values())
    weights = run.trainer.objective.members[0].problem.term_weights
    terms = [weight * whole[name] for weight, name in zip(weights, NAMES, strict=True)]
    assert whole["loss"] == pytest.approx(sum(terms), rel=1e-5)


def test_the_bar_shows_steps_terms_and_values(capsys: pytest.CaptureFixture[str]) -> None:
    bar = Bar()
    bar.at("fit", 0, 10)
    bar.at("fit", 4, 10, described(row(4)))
    bar.message("a [bracket] is no markup")
    bar.at("fit", 8, 8, described(row(8)))
    bar.live.refresh()
    (task,) = bar.bar.tasks
    assert (task.description, task.fields["left"]) == ("fit 8/8", "0:00 left")
    assert bar.text.startswith("mu_s 0.4000")
    bar.stop()
    text = capsys.readouterr().err
    assert "a [bracket] is no markup" in text
