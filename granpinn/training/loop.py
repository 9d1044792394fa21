"""A training from its first step, or its newest checkpoint, to its end.

`TrainingLoop` calls the steps of a `Trainer`. Between them it writes the history and checkpoints,
stops at signals, rolls back members that diverge, and keeps a time limit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import torch

from granpinn.config import Config, ConfigError
from granpinn.errors import Interrupted
from granpinn.progress import Progress
from granpinn.signals import Signals, caught
from granpinn.training import checkpoint, identity, time_limit
from granpinn.training.checkpoint import RunState
from granpinn.training.guard import NonFiniteError
from granpinn.training.history import History, described, median, row_of
from granpinn.training.objective import Objective
from granpinn.training.schedule import Schedule
from granpinn.training.trainer import Trainer

UNLIMITED = 2**53  # steps
FIT = "fit"  # the training as a stage
CORRECT_EVERY = 0.05  # of the time limit, between corrections of the schedule


class TrainingLoop:
    """The training of one run.

    Args:
        folder: the run folder; None writes nothing to disk.
        members: folders of the histories of several members; None for a single member, whose
            history is in the run folder.
        limit: when the run has to end; None without a time limit.

    Attributes:
        limit: None also where a checkpoint brought its schedule.
        wall_s: time spent in training, over all resumptions.
        stopped: what limited the steps, "steps" or "max_time".
    """

    def __init__(
        self,
        objective: Objective,
        config: Config,
        folder: Path | None,
        progress: Progress,
        limit: time_limit.Limit | None = None,
        members: Sequence[Path | None] | None = None,
    ) -> None:
        self.config = config
        self.single = members is None
        self.progress = progress
        self.limit = limit
        self.stopped = "steps"
        self.checkpoints = None if folder is None else folder / "checkpoint"
        parts = [folder] if members is None else members
        self.histories = [
            History(part / "history.csv" if part else None, law)
            for part, law in zip(parts, objective.laws, strict=False)
        ]
        self.objective = objective
        self.at_most = _steps(config, max(len(m.data.points) for m in objective.members))
        schedule = Schedule(self.at_most, config.optimizer)
        self.trainer = Trainer(objective, schedule, config)
        self.wall_s = 0.0

    @cached_property
    def identity(self) -> tuple[dict[str, Any], tuple[dict[str, Any], ...], str]:
        """Settings, members and data, for checkpoints (identity.py)."""
        members = tuple(identity.of_member(member) for member in self.objective.members)
        return identity.of_settings(self.config), members, identity.of_data(self.objective)

    def train(self) -> None:
        """Train to the end; Interrupted, NonFiniteError or CheckpointError if that fails."""
        trainer = self.trainer
        try:
            resumed = self.config.resume and self._resume()
            if not resumed:
                self._begin()
            self.progress.at(FIT, trainer.step, trainer.schedule.total)
            with caught() as signals:
                self._loop(signals)
        finally:
            for history in self.histories:
                history.close()

    def _begin(self) -> None:
        if self.limit is not None:
            schedule = time_limit.schedule_within(self.limit, self.trainer, self.at_most)
            self.trainer.schedule = schedule
            self.stopped = "steps" if schedule.total == self.at_most else "max_time"
        for history in self.histories:
            history.begin()
        self._mark()
        self._save()

    def _resume(self) -> bool:
        """Restore the newest checkpoint; False without one."""
        if self.checkpoints is None:
            raise ConfigError("resume needs a run folder: give run_dir (--out of the command)")
        found = checkpoint.newest(self.checkpoints)
        if found is None:
            self.progress.message(f"{self.checkpoints} holds no checkpoint yet: starting anew")
            return False
        checkpoint.require_same(found, *self.identity)
        for name, tensor in self.trainer.tensors().items():
            tensor.copy_(found.tensors[name])
        self.trainer.set_plain_state(found.state.training)
        self.wall_s, self.stopped = found.state.wall_s, found.state.stopped
        self.limit = None  # the schedule of the checkpoint stays
        for history, table in zip(self.histories, found.histories, strict=True):
            history.begin(row_of(history.law, row) for row in table.tolist())
        self._mark()
        return True

    def _mark(self) -> None:
        """Start the clocks of this process."""
        self.started = self.saved = time.monotonic()
        self.corrected = self.trainer.step, self.started
        self.before = self.wall_s

    def _loop(self, signals: Signals) -> None:
        trainer, config = self.trainer, self.config
        while not trainer.finished and signals.received is None:
            before, row, due = trainer.step, False, False
            try:
                trainer.advance()
                row = trainer.step % config.log_every == 0 or trainer.finished
                due = time.monotonic() - self.saved >= config.checkpoint_every
                if row or due:
                    trainer.require_finite()
            except NonFiniteError as error:
                self._recover(error)
                continue
            if trainer.step <= before:
                continue
            if row:
                self._log()
            if due:
                self._save()
        self._save()
        where = "" if self.checkpoints is None else f"; {self.checkpoints} holds it, --resume"
        message = f"stopped at step {trainer.step}{where}"
        if signals.received is not None:
            raise Interrupted(signals.received, message)
        signals.stop_at_once(message)
        until = math.inf
        if self.limit is not None:
            pace = (time.monotonic() - self.started) / max(1, trainer.step)
            until = self.limit._replace(steps=0.0).deadline(pace)
        self.progress.stage("last layer")
        trainer.solve_last_layer(until)
        self.wall_s = self.before + time.monotonic() - self.started

    def _log(self) -> None:
        now = time.monotonic()
        self.wall_s = self.before + now - self.started
        trainer = self.trainer
        rows = trainer.rows(self.wall_s)
        for history, row in zip(self.histories, rows, strict=True):
            history.append(row)
        trainer.remember()
        row = median([row for e, row in enumerate(rows) if e not in trainer.diverged])
        self.progress.show(row)
        if self.limit is not None and not trainer.finished:
            self._correct_schedule(now, self.limit)
        self.progress.at(FIT, trainer.step, trainer.schedule.total, described(row))

    def _correct_schedule(self, now: float, limit: time_limit.Limit) -> None:
        trainer, since = self.trainer, self.corrected
        in_prefit = trainer.schedule.in_prefit(trainer.step)
        if not in_prefit and now - since[1] <= CORRECT_EVERY * (limit.until - self.started):
            return
        self.corrected = trainer.step, now
        if in_prefit:
            return
        schedule = time_limit.corrected(trainer, since, limit, self.at_most)
        if schedule != trainer.schedule:
            trainer.schedule = schedule
            trainer.remember()

    def _recover(self, error: NonFiniteError) -> None:
        """Roll a faulty member back; at its second fault freeze it, or raise if it is alone."""
        trainer, many = self.trainer, not self.single
        where = "" if self.checkpoints is None else f"; {self.checkpoints} holds a good state"
        again = {
            e: f"{text} again, after a rollback at half the learning rate: lower "
            f"--optimizer.learning_rate or look at the data{'' if many else where}"
            for e, text in error.members.items()
            if trainer.lr_scale[e] < 1
        }
        fresh = error.members.keys() - again.keys()
        trainer.give_up(again)
        if self.single and again:
            raise NonFiniteError(again[0]) from error
        for e, text in again.items():
            self.progress.message(f"member {e} is given up: {text}")
        if fresh:
            copied = trainer.remembered
            trainer.roll_back(fresh)
            if trainer.step == copied:
                for history in self.histories:
                    history.begin([row for row in history.rows if row["step"] <= copied])
            who = f"members {', '.join(map(str, sorted(fresh)))} " if many else ""
            self.progress.message(
                f"{error}: {who}back to step {copied}, on at half the learning rate"
            )

    def _save(self) -> None:
        if self.checkpoints is None:
            return
        self.wall_s = self.before + time.monotonic() - self.started
        settings, members, data_sha256 = self.identity
        for history in self.histories:
            history.flush()
        state = RunState(
            training=self.trainer.plain_state(),
            wall_s=self.wall_s,
            stopped=self.stopped,
            settings=settings,
            members=members,
            data_sha256=data_sha256,
        )
        tables = [torch.from_numpy(history.table) for history in self.histories]
        checkpoint.save(self.checkpoints, self.trainer.tensors(), tables, state)
        self.saved = time.monotonic()


def _steps(config: Config, n_points: int) -> int:
    """Number of steps in the settings, given as steps or as epochs."""
    if config.steps is not None:
        return config.steps
    if config.epochs is not None:
        return config.epochs * -(-n_points // config.batch.interior)
    return UNLIMITED
