"""Paths that are read: nothing waits on a FIFO, reads a device or follows a link to itself."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granpinn
from granpinn import importers
from granpinn.commands import convert, inspect, train
from granpinn.config.toml import read_toml
from granpinn.data import read_flow
from granpinn.fit.network_file import read_network
from granpinn.importers import series
from granpinn.regular import read_text
from granpinn.results import read_fields, read_results
from granpinn.training.checkpoint import CheckpointError, newest
from granpinn.training.history import read_history

KINDS: dict[str, Callable[[Path], None]] = {
    "FIFO": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "link to itself": lambda path: path.symlink_to(path),
    "folder": Path.mkdir,
}
ARRAYS: dict[str, Any] = {
    **{name: np.arange(3.0) for name in "tyx"},
    **{name: np.ones((3, 3, 3)) for name in ("u", "v", "c")},
}
PLAIN: dict[str, Any] = {"dimensionless": True, "grain_diameter": "0.1"}


def newest_beside(path: Path) -> None:
    path.rename(path.with_name(f"step-000000001-{'0' * 16}.safetensors"))
    try:
        newest(path.parent)
    except CheckpointError as error:
        raise ValueError(str(error)) from None


READERS: dict[str, Callable[[Path], object]] = {
    "text": read_text,
    "settings": read_toml,
    "flow": read_flow,
    "results.json": read_results,
    "history.csv": read_history,
    "fields.h5": read_fields,
    "network": read_network,
    "checkpoint": newest_beside,
    "surface": lambda path: importers.read(ARRAYS, surface=str(path), **PLAIN),
    "walls": lambda path: importers.read(ARRAYS, walls=str(path), **PLAIN),
    "times": lambda path: importers.read(ARRAYS, times=str(path), **PLAIN),
    "mask": lambda path: importers.read(ARRAYS, mask=str(path), **PLAIN),
    **{
        f"vectors as {name}": lambda path, name=name: importers.read(path, format=name, **PLAIN)
        for name in ("auto", *series.FORMATS)
    },
    "run": lambda path: granpinn.load(path).history,
}
COMMANDS: dict[str, Callable[[Path], int]] = {
    "train FLOW": lambda path: train.main([str(path), "--out", f"{path}.run"]),
    "train --config": lambda path: train.main(["a.h5", "--out", "b", "--config", str(path)]),
    "inspect FLOW": lambda path: inspect.main([str(path)]),
    "convert IN": lambda path: convert.main([str(path), "--out", f"{path}.h5"]),
    "convert IN to an old file": lambda path: convert.main([str(path), "--out", __file__]),
}


@pytest.fixture(autouse=True)
def deadline() -> Iterator[None]:
    """Ends a test that waits."""

    def late(signum: int, frame: object) -> None:
        pytest.fail("waited for a file that is no regular one")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("reader", READERS)
def test_nothing_but_a_regular_file_is_read(reader: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "place"
    KINDS[kind](path)
    with pytest.raises(ValueError, match=".") as caught:  # every refusal of granpinn is one
        READERS[reader](path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_refuses_what_is_no_regular_file(
    command: str, kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "place"
    KINDS[kind](path)
    assert COMMANDS[command](path) == 2
    refusal = capsys.readouterr().err
    assert refusal.count("\n") == 1
    assert "bug" not in refusal


def test_a_text_larger_than_it_can_be_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    with path.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(ValueError, match="at most 0.25 GiB of data, got 1.02e"):
        read_results(path)


def test_settings_in_a_thousand_brackets_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text("steps = " + "[" * 3000)
    with pytest.raises(ValueError, match="could not be read as TOML: maximum recursion depth"):
        read_toml(path)
