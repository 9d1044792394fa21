"""Errors name settings as Python does, and in a command as its flags."""

from __future__ import annotations

import pytest

from granpinn.commands.train import main
from granpinn.config import Config, ConfigError
from granpinn.errors import BadInput, CannotGoOn


@pytest.mark.parametrize("kind", [BadInput, CannotGoOn])
@pytest.mark.parametrize(
    ("flags", "python"),
    [
        ("one of --steps and --max-time, got none", "one of steps and max_time, got none"),
        ("--network.widths: use --I0 0.3", "network.widths: use I0 0.3"),
        ("give --scale, or --fields u=U.", "give scale, or fields u=U."),
        ("run granpinn convert a.vec --out flow.h5", "run granpinn convert a.vec --out flow.h5"),
        ("--I0 must be 1: --help explains it", "I0 must be 1: help(granpinn.Config) explains it"),
        ("a -- b --- c, a--b", "a -- b --- c, a--b"),
    ],
)
def test_flags_become_names(kind: type[BadInput | CannotGoOn], flags: str, python: str) -> None:
    assert str(kind(flags)) == python
    assert kind(flags).for_commands == flags


def test_a_wrong_setting_has_both_names(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ConfigError, match="^max_time must be "):
        Config(max_time=-1.0)
    assert main(["flow.h5", "--out", "run", "--max-time", "-1"]) == 2
    assert capsys.readouterr().err.startswith("granpinn.train: --max-time must be ")
