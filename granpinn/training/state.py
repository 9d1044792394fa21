"""The plain values of a checkpoint, typed and in their ranges.

The JSON of a checkpoint is decoded into these classes, so no value of another type or range reaches
a training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

MOST_STEPS = 2**53  # whole numbers up to here are exact in JSON readers of any language


@dataclass(frozen=True)
class TrainingState:
    """The state of E members beside their tensors.

    Attributes:
        step: number of steps that were made.
        averaged: number of steps in the running average.
        lr_scale: factor on the learning rates of each member [E].
        misfit: rms velocity misfit of each member after the pre-fit [E].
        diverged: number of a frozen member as text -> the reason.
        total, from_step, from_progress: of the schedule.
    """

    step: int
    averaged: int
    lr_scale: tuple[float, ...]
    misfit: tuple[float, ...]
    diverged: dict[str, str]
    total: int
    from_step: int
    from_progress: float

    def __post_init__(self) -> None:
        _within("total", self.total, 1, MOST_STEPS)
        _within("step", self.step, 0, self.total)
        _within("averaged", self.averaged, 0, self.step)
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
        history_bytes, history_sha256: length of the history.csv of each member, and SHA-256 of its
            content [E].
        wall_s: seconds of training so far.
        stopped: the setting that limits the steps.
        settings, members, data_sha256: the identity of the run (identity.py).
    """

    training: TrainingState
    history_bytes: tuple[int, ...]
    history_sha256: tuple[str, ...]
    wall_s: float
    stopped: str
    settings: dict[str, Any]
    members: tuple[dict[str, Any], ...]
    data_sha256: str

    def __post_init__(self) -> None:
        E = len(self.training.lr_scale)
        _count("history_bytes", self.history_bytes, E)
        _count("history_sha256", self.history_sha256, E)
        _count("members", self.members, E)
        for length in self.history_bytes:
            _within("history_bytes", length, 0, MOST_STEPS)
        _within("wall_s", self.wall_s, 0, float("inf"))
        if self.stopped not in ("steps", "max_time", "on_step"):
            raise ValueError(f"stopped must be steps, max_time or on_step, got {self.stopped!r}")


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} must be from {low} to {high}, got {value}")


def _count(name: str, values: Sequence[object], count: int) -> None:
    if len(values) != count:
        raise ValueError(f"{name} must have one entry for each of {count} members")
