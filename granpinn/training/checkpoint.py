"""Checkpoints that survive a crash at any moment.

A checkpoint is two files in `<run>/checkpoint/`: `step-N.safetensors` holds every tensor of the
training state, `step-N.json` the rest and the SHA-256 of the first. Each is written to a temporary
file, flushed to disk and renamed, tensors first. So a checkpoint is complete once its JSON exists.
The two newest are kept. If the newest is damaged, the one before it is read.

The files hold no pickle, so reading them executes no code.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors import torch as safetensors
from torch import Tensor

from granpinn.atomic import atomic_path
from granpinn.errors import CannotGoOn

FORMAT_NAME = "granpinn-checkpoint"
FORMAT_VERSION = 2
KEPT = 2


class CheckpointError(CannotGoOn):
    """A checkpoint cannot be written or used; the message is one sentence with its path."""


@dataclass(frozen=True)
class Checkpoint:
    """The content of a pair of files: the tensors by name and the plain values of the JSON."""

    path: Path
    tensors: dict[str, Tensor]
    state: dict[str, Any]


def save(folder: Path, step: int, tensors: Mapping[str, Tensor], state: Mapping[str, Any]) -> Path:
    """Write the checkpoint of `step` and remove all but the two newest; path of the JSON.

    CheckpointError: a tensor holds a NaN or an infinity, or a file cannot be written.
    """
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise CheckpointError(
                f"{folder} was not written to: {name} holds a NaN or an infinity at step {step}"
            )
    path = folder / f"step-{step:09d}.safetensors"
    content = safetensors.save({name: t.cpu().contiguous() for name, t in tensors.items()})
    header = {
        "format_name": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "step": step,
        "tensors_sha256": hashlib.sha256(content).hexdigest(),
    }
    text = json.dumps(header | dict(state), indent=2, allow_nan=False)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write(path, content)
        path = path.with_suffix(".json")
        _write(path, text.encode())
        _prune(folder)
    except OSError as error:
        raise CheckpointError(
            f"checkpoint {path} could not be written ({error.strerror or error}): make room or "
            f"choose another --out; the checkpoints before it are intact, --resume continues there"
        ) from error
    return path


def _write(path: Path, content: bytes) -> None:
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def _prune(folder: Path) -> None:
    """Keep the newest two checkpoints; remove the temporary files of a killed process."""
    kept = {path.stem for path in _newest_first(folder)[:KEPT]}
    for path in folder.glob("step-*.*"):
        if path.stem not in kept:
            path.unlink()
    for path in folder.glob(".step-*.tmp"):
        path.unlink()


def _newest_first(folder: Path) -> list[Path]:
    return sorted(folder.glob("step-*.json"), reverse=True)


def newest(folder: Path) -> Checkpoint | None:
    """The newest undamaged checkpoint; None without any, CheckpointError if all are damaged."""
    damaged = []
    for path in _newest_first(folder):
        try:
            return _read(path)
        except (OSError, ValueError, SafetensorError) as error:
            damaged.append(f"{path}: {error}")
    if damaged:
        raise CheckpointError(
            f"no checkpoint can be read ({'; '.join(damaged)}): start again with another --out"
        )
    return None


def _read(path: Path) -> Checkpoint:
    state = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    if not isinstance(state, dict):
        raise ValueError(f"expected a JSON object, got {type(state).__name__}")
    found = (state.get("format_name"), state.get("format_version"))
    if found != (FORMAT_NAME, FORMAT_VERSION):
        raise ValueError(f"expected {FORMAT_NAME} version {FORMAT_VERSION}, got {found}")
    content = path.with_suffix(".safetensors").read_bytes()
    if hashlib.sha256(content).hexdigest() != state.get("tensors_sha256"):
        raise ValueError("its tensors are not those that were saved with it")
    return Checkpoint(path, safetensors.load(content), state)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a JSON number")


def require_same(checkpoint: Checkpoint, settings: Mapping[str, Any], input_sha256: str) -> None:
    """Raise CheckpointError, with the difference, for other settings or another flow file."""
    saved = checkpoint.state.get("settings")
    if not isinstance(saved, dict) or checkpoint.state.get("input_sha256") is None:
        raise CheckpointError(f"{checkpoint.path} lacks its settings or the hash of its flow file")
    for name, value in settings.items():
        if saved.get(name) != plain(value):
            raise CheckpointError(
                f"{checkpoint.path} belongs to a run with {name} = {saved.get(name)}, this one has "
                f"{value}: give the same settings, or another --out for a new run"
            )
    if checkpoint.state["input_sha256"] != input_sha256:
        raise CheckpointError(
            f"{checkpoint.path} belongs to a run on another flow file: give the same FLOW, or "
            f"another --out for a new run"
        )


def plain(value: Any) -> Any:
    """`value` as strict JSON, which has no number for infinity: it becomes the text "inf"."""
    return str(value) if isinstance(value, float) and math.isinf(value) else value


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
