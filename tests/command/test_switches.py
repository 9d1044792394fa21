"""The flags of `granpinn train`: switches, the two helps, and the nearest flag."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from granpinn.command.next_step import require_flow_file
from granpinn.command.parser import PACKAGE, program
from granpinn.commands.train import USUAL, parse
from granpinn.config import Config, ConfigError, settings_of
from granpinn.config.fields import flag_of
from granpinn.errors import BadInput
from granpinn.importers import DataFileError

RUN = ("flow.h5", "--out", "run")
FLAG = re.compile(r"^\s+(?:-\w, )?(--[A-Za-z][\w.-]*)", re.MULTILINE)


@pytest.mark.parametrize(
    ("words", "on"),
    [
        (["--optimizer.last_layer", "false"], False),
        (["--optimizer.last_layer=false"], False),
        (["--no-optimizer.last_layer"], False),
        (["--optimizer.last_layer"], True),
        (["--optimizer.last_layer", "True"], True),
        ([], True),
    ],
    ids=str,
)
def test_what_is_on_can_be_switched_off(words: list[str], on: bool) -> None:
    assert parse([*RUN, *words]).config.optimizer.last_layer is on


def test_a_switch_does_not_take_the_flow_file() -> None:
    config = parse(["--out", "run", "--resimulate", "flow.h5"]).config
    assert (config.flow, config.resimulate) == ("flow.h5", True)
    with pytest.raises(ConfigError, match="must be true or false, got 'perhaps'"):
        parse([*RUN, "--resimulate=perhaps"])


@pytest.mark.parametrize(
    ("flag", "meant"),
    [
        ("--levle", "--level"),
        ("--last_layer", "--optimizer.last_layer"),
        ("--max_time", "--max-time"),
        ("--no-last_layer", "--optimizer.last_layer"),
    ],
)
def test_a_flag_that_is_unknown_comes_with_the_nearest_one(flag: str, meant: str) -> None:
    with pytest.raises(BadInput, match=re.escape(f"did you mean {meant}?")):
        parse([*RUN, flag, "1"])


def test_the_help_has_few_flags_and_the_other_help_all(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        parse(["--help"])
    usual = FLAG.findall(capsys.readouterr().out)
    assert len(usual) == 19  # and --help itself
    with pytest.raises(SystemExit):
        parse(["--help-all"])
    everything = set(FLAG.findall(capsys.readouterr().out))
    known = settings_of(Config)
    assert everything >= {flag_of(key) for key in known if "flow" not in key}
    assert set(USUAL) <= set(known)


def test_a_command_speaks_as_it_was_called(monkeypatch: pytest.MonkeyPatch) -> None:
    for called, name in {
        "/usr/bin/granpinn": "granpinn train",
        str(PACKAGE / "__main__.py"): "granpinn train",
        str(PACKAGE / "commands" / "train.py"): "python -m granpinn.train",
    }.items():
        monkeypatch.setattr(sys, "argv", [called])
        assert program("train") == name


def test_training_on_files_of_an_instrument_says_how_to_convert_them(tmp_path: Path) -> None:
    path = tmp_path / "a.vec"
    path.write_text('TITLE="a" VARIABLES="X mm", "Y mm", "U m/s", "V m/s", "CHC", ZONE I=1, J=1\n')
    with pytest.raises(DataFileError, match=r"granpinn convert .*a\.vec --out flow\.h5 --scale"):
        require_flow_file(path)
    (tmp_path / "b").write_bytes(b"\x00\x01garbage")
    require_flow_file(tmp_path / "b")  # the reader of flow files refuses it
