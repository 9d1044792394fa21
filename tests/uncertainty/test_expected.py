"""Several flows before their training: what they determine together, and which flow is next."""

from __future__ import annotations

from pathlib import Path

import pytest

from granpinn.commands.inspect import run
from granpinn.config import ConfigError
from granpinn.data import Flow, write_flow
from granpinn.data.noise import add_noise
from granpinn.uncertainty.expected import _of_range, experiments, percent


def test_a_steep_chute_finds_I0_that_collapses_leave_open() -> None:
    slow = [_of_range(I, False) for I in ((0.002, 0.05), (0.004, 0.1))]
    chute = _of_range(list(experiments().values())[-1], False)
    assert percent(slow)["I0, I0 free"] > 50
    assert percent([*slow, chute])["I0, I0 free"] < 20
    assert percent([*slow, chute])["mu_2"] < percent(slow)["mu_2"] / 2


def test_the_command_takes_several_flows(
    flow: Flow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [str(tmp_path / name) for name in ("a.h5", "b.h5")]
    for path in paths:
        write_flow(flow, Path(path))
    assert run(paths) == 0
    text = capsys.readouterr().out
    assert "a.h5: I = " in text
    assert "and a chute from rest" in text
    assert "--one-law" in text
    assert "holds I0" not in text
    write_flow(add_noise(flow, 0.05, seed=0), Path(paths[0]))
    assert run(paths) == 0
    assert "a training holds I0: the noise of a flow is" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="inspect one at a time"):
        run([*paths, "--json"])
