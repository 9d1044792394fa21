"""Runs on a small flow that take a fraction of a second."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from granpinn.config import Config
from granpinn.data import Flow
from granpinn.data.scaling import scales_of
from granpinn.estimates.facts import Facts
from granpinn.fit.case import fixed_values
from granpinn.physics.laws import LAWS
from granpinn.progress import Progress
from granpinn.training import problem
from granpinn.training.loop import TrainingLoop
from granpinn.training.objective import Member, Objective
from granpinn.training.points import training_set
from granpinn.training.schedule import Schedule
from granpinn.training.trainer import Trainer

TINY = {
    "steps": 40,
    "log_every": 5,
    "network__widths": (9, 7),
    "batch__interior": 33,
    "batch__surface": 6,
}


class Heard(Progress):
    """Keeps what a run says."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def message(self, text: str) -> None:
        self.said.append(text)


def tiny(**changes: Any) -> Config:
    """The default recipe on a tiny network for 40 steps, 12 of them on the velocity alone."""
    return Config(**(TINY | changes))


def make_objective(config: Config, flow: Flow) -> Objective:
    scales = scales_of(flow)
    data = training_set(flow, scales, config.level, getattr(torch, config.dtype))
    facts = Facts(flow, scales)
    posed = problem.build(facts, data, config)
    law = LAWS[config.law]
    member = Member(posed, data, config.seed, law, fixed_values(config, facts), flow)
    return Objective([member], config.batch, torch.device("cpu"), precision=config.precision)


def make_trainer(config: Config, flow: Flow) -> Trainer:
    assert config.steps is not None
    schedule = Schedule(config.steps, config.optimizer)
    return Trainer(make_objective(config, flow), schedule, config)


def make_run(config: Config, flow: Flow, folder: Path | None = None) -> TrainingLoop:
    if folder is not None:
        folder.mkdir(exist_ok=True)
    return TrainingLoop(make_objective(config, flow), config, folder, Progress())
