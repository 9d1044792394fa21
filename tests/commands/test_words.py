"""Words of the user and of files: none acts on the terminal, on a spreadsheet or on a folder."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from granpinn.commands import convert, inspect, report, train
from granpinn.commands.shared import cli
from granpinn.config import ConfigError
from granpinn.config.fields import Setting
from granpinn.data import write_flow
from granpinn.terminal import visible
from tests.flows import make_flow

HOSTILE = "a\x1b[2J\x07\u202eb"


ESCAPED = r"a\x1b[2J\x07\u202eb"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("two\nlines\tand a tab, µ and 流", "two\nlines\tand a tab, µ and 流"),
        (HOSTILE, ESCAPED),
        ("return\r\x9b31m", r"return\r\x9b31m"),
        ("\udc80", r"\udc80"),
    ],
)
def test_control_characters_are_shown_and_not_sent(text: str, expected: str) -> None:
    assert visible(text) == expected


def run(verb: str, *words: object) -> subprocess.CompletedProcess[str]:
    argv = [sys.executable, "-m", f"granpinn.{verb}", *map(str, words)]
    return subprocess.run(argv, capture_output=True, text=True, encoding="utf-8")


def test_names_of_files_do_not_act_on_the_terminal(tmp_path: Path) -> None:
    path = tmp_path / f"{HOSTILE}.h5"
    write_flow(make_flow(frames=6, rows=12, columns=10), path)
    done = run("inspect", path)
    assert done.returncode == 0, done.stderr
    assert r"a\x1b[2J\x07" in done.stdout
    assert not {"\x1b", "\x07", "\u202e"} & {*done.stdout, *done.stderr}


EMPTY: dict[str, Callable[..., int]] = {
    "train": lambda *words: train.main(["a.h5", *words]),
    "convert": lambda *words: convert.main(["a.txt", *words]),
    "inspect": lambda *words: inspect.main(["a.h5", *words]),
    "simulate": lambda *words: cli.command("simulate").main(list(words)),
    "report": lambda *words: report.main([*words, ""]),
}


@pytest.mark.parametrize("words", [("--out", ""), ("--out=",)], ids=["a word", "one word"])
@pytest.mark.parametrize("command", EMPTY)
def test_an_empty_path_is_not_the_current_folder(
    command: str,
    words: tuple[str, ...],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert EMPTY[command](*words) == 2
    assert "every argument must have a value, got '" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["1_0", "١٠", "1_0.5", "１", "1e1_0"])
def test_a_number_has_plain_digits(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    for kind in (int, float):
        with pytest.raises(ConfigError, match="steps must be a"):
            Setting(kind, None, "").of_text(text, "--steps")
    for command, words in (
        (train.main, ["a.h5", "--out", "b", "--members", text]),
        (train.main, ["a.h5", "--out", "b", "--I0", text]),
        (convert.main, ["a.txt", "--out", "b.h5", "--track-window", text]),
        (convert.main, ["a.txt", "--out", "b.h5", "--solid-fraction", text]),
        (report.main, ["a", "--time", text]),
    ):
        assert command(words) == 2
        assert "number, got " in capsys.readouterr().err
