"""Checkpoints that survive a crash at any moment.

A checkpoint is one file in `<run>/checkpoint/`, with every tensor of the training state, the rows
of each history.csv (history.py) and the plain values (tensor_file.py). Its name has the step and a
checksum of its bytes: a changed bit anywhere is damage, and only a whole checkpoint can belong to
another run. The file is written beside its place, flushed to disk and renamed. The two newest are
kept; if the newest is damaged, the one before it is read.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from granpinn.data.large import available
from granpinn.errors import CannotGoOn
from granpinn.output import OutputError, make_folder, naming, write_bytes
from granpinn.regular import read_regular_file
from granpinn.training.identity import difference
from granpinn.training.tensor_file import packed, unpacked


@dataclass(frozen=True)
class TrainingState:
    """The state of E members beside their tensors.

    Attributes:
        step: number of steps that were made.
        lr_scale: factor on the learning rates of each member [E].
        misfit: rms velocity misfit of each member after the pre-fit [E].
        diverged: number of a frozen member as text -> the reason.
        total, from_step, from_progress: of the schedule.
    """

    step: int
    lr_scale: tuple[float, ...]
    misfit: tuple[float, ...]
    diverged: dict[str, str]
    total: int
    from_step: int
    from_progress: float


@dataclass(frozen=True)
class RunState:
    """The plain values of a checkpoint.

    Attributes:
        wall_s: seconds of training so far.
        stopped: the setting that limits the steps.
        settings, members, data_sha256: the identity of the run (identity.py).
    """

    training: TrainingState
    wall_s: float
    stopped: str
    settings: dict[str, Any]
    members: tuple[dict[str, Any], ...]
    data_sha256: str


FORMAT = "granpinn-checkpoint", 7  # name and version
KEPT = 2
NAME = re.compile(r"step-(\d{9,16})-([0-9a-f]{16})\.safetensors", re.ASCII)
TEMPORARY = re.compile(rf"\.{NAME.pattern}\.[0-9a-f]{{8}}\.tmp", re.ASCII)
LONGEST = 300  # characters of the reason why a checkpoint cannot be read


class CheckpointError(CannotGoOn):
    """A checkpoint cannot be written or used; the message is one sentence with its path."""


@dataclass(frozen=True)
class Checkpoint:
    """The content of a file.

    Attributes:
        tensors: of the training state, by name.
        histories: the rows of the history of each member [rows, columns].
        state: the plain values.
    """

    path: Path
    tensors: dict[str, Tensor]
    histories: list[Tensor]
    state: RunState


def save(
    folder: Path, tensors: Mapping[str, Tensor], histories: Sequence[Tensor], state: RunState
) -> Path:
    """Write the checkpoint of a step and remove all but the two newest; its path.

    CheckpointError: a tensor holds a NaN or an infinity, a file cannot be written, or the run
    folder is gone.
    """
    step = state.training.step
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise CheckpointError(
                f"{folder} was not written to: {name} holds a NaN or an infinity at step {step}"
            )
    rows = {f"history.{e}": table for e, table in enumerate(histories)}
    content = packed(*FORMAT, state, {**tensors, **rows})
    path = folder / f"step-{step:09d}-{_checksum(content)}.safetensors"
    try:
        if not folder.parent.is_dir():
            raise CheckpointError(
                f"{folder.parent} was removed during the run: start again with an --out that stays"
            )
        make_folder(folder)
        write_bytes(path, content)
        with naming(folder):
            _prune(folder, step, path)
    except OutputError as error:
        raise CheckpointError(
            f"{error}; the checkpoints before it are intact, and --resume continues there"
        ) from error
    return path


def _checksum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _prune(folder: Path, step: int, new: Path) -> None:
    """Keep the new checkpoint and the newest before it; remove what a killed process left."""
    every = _newest_first(folder)
    kept = {new, *[path for s, path in every if s < step][: KEPT - 1]}
    left = [path for path in folder.iterdir() if TEMPORARY.fullmatch(path.name)]
    for path in [*left, *(path for _, path in every if path not in kept)]:
        path.unlink()


def _newest_first(folder: Path) -> list[tuple[int, Path]]:
    """The steps of the checkpoints, and their files."""
    named = [(NAME.fullmatch(path.name), path) for path in folder.glob("step-*")]
    return sorted([(int(match[1]), path) for match, path in named if match], reverse=True)


def newest(folder: Path) -> Checkpoint | None:
    """The newest undamaged checkpoint; None without any, CheckpointError if all are damaged."""
    damaged = []
    for _, path in _newest_first(folder):
        try:
            return _read(path)
        except (ValueError, LookupError) as error:
            damaged.append(f"{path}: {str(error)[:LONGEST]}")
    if damaged:
        raise CheckpointError(
            f"no checkpoint can be read ({'; '.join(damaged)}): start again with another folder"
        )
    return None


def _read(path: Path) -> Checkpoint:
    content = read_regular_file(path, available(), "it is no checkpoint of granpinn")
    if not path.stem.endswith(_checksum(content)):
        raise ValueError("it was changed after it was saved")
    state, tensors = unpacked(content, *FORMAT, RunState)
    histories = [tensors.pop(f"history.{e}") for e in range(len(state.members))]
    return Checkpoint(path, tensors, histories, state)


def require_same(
    checkpoint: Checkpoint,
    settings: Mapping[str, Any],
    members: Sequence[Mapping[str, Any]],
    data_sha256: str,
) -> None:
    """Raise CheckpointError, with the difference, for another identity (identity.py)."""
    saved, advice = checkpoint.state, "give the same settings"
    found = difference(saved.settings, settings)
    if found is None:
        advice = "give the same FLOW"
        found = next(filter(None, map(difference, saved.members, members)), None)
        if len(saved.members) != len(members):
            found = f"{len(saved.members)} members, this one has {len(members)}"
    if found is None and saved.data_sha256 == data_sha256:
        return
    what = "on another flow file" if found is None else f"with {found}"
    raise CheckpointError(
        f"{checkpoint.path} belongs to a run {what}: {advice}, or another folder for a new run"
    )
