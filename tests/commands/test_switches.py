"""The flags of `granpinn train`: switches, the two helps, and the nearest flag."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from granpinn.commands.shared.flow_files import require_flow_files
from granpinn.commands.train import parse
from granpinn.errors import BadInput

RUN = ("flow.h5", "--out", "run")


@pytest.mark.parametrize(
    ("words", "on"),
    [
        (["--no-optimizer.last_layer"], False),
        (["--optimizer.last_layer"], True),
        ([], True),
    ],
    ids=str,
)
def test_what_is_on_can_be_switched_off(words: list[str], on: bool) -> None:
    assert parse([*RUN, *words])[0].optimizer.last_layer is on


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


def test_training_on_files_of_an_instrument_says_how_to_convert_them(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("# x y u v flags mask\n1 1 1 1 0 0\n")
    with pytest.raises(BadInput, match=r"granpinn convert .*a\.txt --out flow\.h5 --scale"):
        require_flow_files([path], "train on")
    (tmp_path / "b").write_bytes(b"\x00\x01garbage")
    require_flow_files([tmp_path / "b"], "train on")  # the reader of flow files refuses it
