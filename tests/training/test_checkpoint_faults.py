"""Gate T-3: whatever fails while a checkpoint is saved, the last or the previous one is whole."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from granpinn.training.checkpoint import CheckpointError, newest
from tests.training.test_checkpoint import TENSORS, saved

# What `save` asks of the operating system, each of which may fail at any of its calls.
CALLS: list[tuple[Any, str]] = [
    (os, "open"),
    (os, "close"),
    (os, "fsync"),
    (pathlib.Path, "write_bytes"),
    (pathlib.Path, "replace"),
    (pathlib.Path, "unlink"),
    (pathlib.Path, "mkdir"),
]


class Faulty:
    """A function of the operating system that fails at one of its calls."""

    def __init__(self, real: Callable[..., Any], at_call: int) -> None:
        self.real, self.at_call, self.calls = real, at_call, 0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        self.calls += 1
        if self.calls == self.at_call + 1:
            raise OSError(28, "No space left on device")
        return self.real(*args, **kwargs)


def save_or_message(folder: Path, step: int) -> str | None:
    """The message of the CheckpointError, None where the checkpoint was saved."""
    try:
        saved(folder, step)
    except CheckpointError as error:
        return str(error)
    return None


@pytest.mark.parametrize(("owner", "name"), CALLS, ids=[name for _, name in CALLS])
def test_a_fault_at_any_call_leaves_the_checkpoint_before_it(
    owner: Any, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    faults = 0
    while True:
        folder = tmp_path / str(faults)
        saved(folder, 1, 2)
        faulty = Faulty(getattr(owner, name), at_call=faults)
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, lambda *a, faulty=faulty, **k: faulty(*a, **k))
            message = save_or_message(folder, 3)
        found = newest(folder)
        assert found is not None
        assert found.state.training.step in (2, 3)
        assert torch.equal(found.tensors["params"], TENSORS["params"] + found.state.training.step)
        saved(folder, 4)
        assert len(list(folder.iterdir())) == 2
        if faulty.calls <= faults:
            break
        faults += 1
        if message is not None:  # a temporary file that cannot be removed is no fault of the save
            assert str(folder) in message
            assert "No space left on device" in message
    assert faults == faulty.calls > 0
