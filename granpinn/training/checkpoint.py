"""Checkpoints that survive a crash at any moment.

A checkpoint is two files in `<run>/checkpoint/`: `step-N.safetensors` holds every tensor of the
training state, `step-N.json` the rest and one SHA-256 over both. Each is written to a temporary
file, flushed to disk and renamed, tensors first. So a checkpoint is complete once its JSON exists.
The two newest are kept. If the newest is damaged, the one before it is read.

The JSON has one form alone: it is read only if writing its content again gives the same bytes. So a
changed bit anywhere in either file is damage, and only a whole checkpoint can belong to another
run. The tensors include the rows of each history.csv (history.py).

The files hold no pickle, so reading them executes no code. The JSON is decoded into typed classes,
so no value of another type or range reaches a training.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors import torch as safetensors
from torch import Tensor

from granpinn.data.large import available
from granpinn.errors import CannotGoOn
from granpinn.output import OutputError, make_folder, naming, write_bytes
from granpinn.regular import read_regular_file
from granpinn.results.decoding import decode, encode, parsed
from granpinn.training.identity import difference

MOST_STEPS = 2**53  # whole numbers up to here are exact in JSON readers of any language


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

    def __post_init__(self) -> None:
        _within("total", self.total, 1, MOST_STEPS)
        _within("step", self.step, 0, self.total)
        _within("from_step", self.from_step, 0, self.step)
        _within("from_progress", self.from_progress, 0, 1)
        if not self.lr_scale or len(self.misfit) != len(self.lr_scale):
            counts = f"{len(self.lr_scale)} and {len(self.misfit)}"
            raise ValueError(f"lr_scale and misfit must have one value a member, got {counts}")
        for scale in self.lr_scale:
            _within("lr_scale", scale, 0, 1)
        for misfit in self.misfit:
            _within("misfit", misfit, 0, float("inf"))
        known = {str(e) for e in range(len(self.lr_scale))}
        if not self.diverged.keys() <= known:
            raise ValueError(f"diverged must name members, got {', '.join(self.diverged)}")


@dataclass(frozen=True)
class RunState:
    """Everything in the JSON of a checkpoint but its format, its step and its checksum.

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

    def __post_init__(self) -> None:
        E = len(self.training.lr_scale)
        if len(self.members) != E:
            raise ValueError(f"members must have one entry for each of {E} members")
        _within("wall_s", self.wall_s, 0, float("inf"))
        if self.stopped not in ("steps", "max_time"):
            raise ValueError(f"stopped must be steps or max_time, got {self.stopped!r}")


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} must be from {low} to {high}, got {value}")


FORMAT_NAME = "granpinn-checkpoint"
FORMAT_VERSION = 5
KEPT = 2
HEAD = ("format_name", "format_version", "step")
NAME = re.compile(r"step-(\d{9,16})\.json", re.ASCII)
PART = re.compile(r"step-\d{9,16}\.(json|safetensors)", re.ASCII)
TEMPORARY = re.compile(rf"\.{PART.pattern}\.[0-9a-f]{{8}}\.tmp", re.ASCII)
LONGEST = 300  # characters of the reason why a checkpoint cannot be read


class CheckpointError(CannotGoOn):
    """A checkpoint cannot be written or used; the message is one sentence with its path."""


@dataclass(frozen=True)
class Checkpoint:
    """The content of a pair of files.

    Attributes:
        tensors: of the training state, by name.
        histories: the rows of the history of each member [rows, columns].
        state: the plain values of the JSON.
    """

    path: Path
    tensors: dict[str, Tensor]
    histories: list[Tensor]
    state: RunState


def save(
    folder: Path, tensors: Mapping[str, Tensor], histories: Sequence[Tensor], state: RunState
) -> Path:
    """Write the checkpoint of a step and remove all but the two newest; path of the JSON.

    CheckpointError: a tensor holds a NaN or an infinity, a file cannot be written, or the run
    folder is gone.
    """
    step = state.training.step
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise CheckpointError(
                f"{folder} was not written to: {name} holds a NaN or an infinity at step {step}"
            )
    path = folder / f"step-{step:09d}.safetensors"
    rows = {f"history.{e}": table for e, table in enumerate(histories)}
    binary = safetensors.save({n: t.cpu().contiguous() for n, t in {**tensors, **rows}.items()})
    head = {"format_name": FORMAT_NAME, "format_version": FORMAT_VERSION, "step": step}
    content = head | encode(state)
    content["sha256"] = _checksum(content, binary)
    try:
        if not folder.parent.is_dir():
            raise CheckpointError(
                f"{folder.parent} was removed during the run: start again with an --out that stays"
            )
        make_folder(folder)
        write_bytes(path, binary)
        path = path.with_suffix(".json")
        write_bytes(path, _text(content))
        with naming(folder):
            _prune(folder)
    except OutputError as error:
        raise CheckpointError(
            f"{error}; the checkpoints before it are intact, and --resume continues there"
        ) from error
    return path


def _text(content: Mapping[str, Any]) -> bytes:
    """The one form of the JSON."""
    return json.dumps(content, allow_nan=False).encode()  # an indent would be slow


def _checksum(content: Mapping[str, Any], binary: bytes) -> str:
    """SHA-256 of the JSON without its checksum, and of the tensors."""
    named = {name: value for name, value in content.items() if name != "sha256"}
    return hashlib.sha256(_text(named) + b"\0" + binary).hexdigest()


def _prune(folder: Path) -> None:
    """Keep the newest two checkpoints; remove the temporary files of a killed process."""
    kept = {path.stem for path in _newest_first(folder)[:KEPT]}
    for path in [*folder.iterdir()]:
        old = PART.fullmatch(path.name) and path.stem not in kept
        if old or TEMPORARY.fullmatch(path.name):
            path.unlink()


def _newest_first(folder: Path) -> list[Path]:
    named = [(NAME.fullmatch(path.name), path) for path in folder.glob("step-*.json")]
    steps = [(int(match[1]), path) for match, path in named if match]
    return [path for _, path in sorted(steps, reverse=True)]


def newest(folder: Path) -> Checkpoint | None:
    """The newest undamaged checkpoint; None without any, CheckpointError if all are damaged."""
    damaged = []
    for path in _newest_first(folder):
        try:
            return _read(path)
        except (ValueError, SafetensorError) as error:
            damaged.append(f"{path}: {str(error)[:LONGEST]}")
    if damaged:
        raise CheckpointError(
            f"no checkpoint can be read ({'; '.join(damaged)}): start again with another folder"
        )
    return None


def _read(path: Path) -> Checkpoint:
    text = _bytes(path)
    content = parsed(text)
    if not isinstance(content, dict):
        raise ValueError(f"expected a JSON object, got {type(content).__name__}")
    found = (content.get("format_name"), content.get("format_version"))
    if found != (FORMAT_NAME, FORMAT_VERSION):
        raise ValueError(f"expected {FORMAT_NAME} version {FORMAT_VERSION}, got {found}")
    binary = _bytes(path.with_suffix(".safetensors"))
    if content.get("sha256") != _checksum(content, binary) or text != _text(content):
        raise ValueError("it was changed after it was saved")
    named = {k: v for k, v in content.items() if k not in (*HEAD, "sha256")}
    state = decode(RunState, named)
    if not content["step"] == state.training.step == int(path.stem.removeprefix("step-")):
        raise ValueError(f"it holds step {content['step']}, which is not that of its name")
    tensors, E = safetensors.load(binary), len(state.members)
    histories = [tensors.pop(name) for e in range(E) if (name := f"history.{e}") in tensors]
    if any(table.ndim != 2 for table in histories) or len(histories) != E:
        raise ValueError(f"expected the histories of {E} members, got {len(histories)}")
    return Checkpoint(path, tensors, histories, state)


def _bytes(path: Path) -> bytes:
    return read_regular_file(path, available(), "it is no checkpoint of granpinn")


def require_same(
    checkpoint: Checkpoint,
    settings: Mapping[str, Any],
    members: Sequence[Mapping[str, Any]],
    data_sha256: str,
) -> None:
    """Raise CheckpointError, with the difference, for another identity (identity.py)."""
    saved = checkpoint.state
    found = difference(saved.settings, settings)
    advice = "give the same settings"
    if found is None:
        advice = "give the same FLOW"
        pairs = zip(saved.members, members, strict=False)
        found = next(filter(None, (difference(*pair) for pair in pairs)), None)
        if len(saved.members) != len(members):
            found = f"{len(saved.members)} members, this one has {len(members)}"
        elif found is None and saved.data_sha256 != data_sha256:
            found = "another flow file"
    if found is not None:
        with_or_on = "on" if found == "another flow file" else "with"
        raise CheckpointError(
            f"{checkpoint.path} belongs to a run {with_or_on} {found}: {advice}, or another folder "
            f"for a new run"
        )


def restore(checkpoint: Checkpoint, live: Mapping[str, Tensor]) -> None:
    """Copy the saved tensors into the live ones; names, shapes and dtypes must agree."""
    if missing := live.keys() ^ checkpoint.tensors.keys():
        raise CheckpointError(
            f"{checkpoint.path} and this run differ in the tensors {', '.join(sorted(missing))}: "
            f"it was written by another version of granpinn"
        )
    for name, tensor in live.items():
        saved = checkpoint.tensors[name]
        expected, got = (tensor.dtype, tuple(tensor.shape)), (saved.dtype, tuple(saved.shape))
        if expected != got:
            raise CheckpointError(
                f"{checkpoint.path}: {name} must be {expected[0]} {list(expected[1])}, "
                f"got {got[0]} {list(got[1])}"
            )
        if not torch.isfinite(saved).all():
            raise CheckpointError(f"{checkpoint.path}: {name} holds a NaN or an infinity")
    for name, tensor in live.items():
        tensor.copy_(checkpoint.tensors[name])
