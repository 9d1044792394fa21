"""The number of steps of a run with a time limit.

Before the run begins, the time of a few steps is measured. The schedule then has as many steps as
fit, so that the learning rate is annealed to its end when the time is up. Later measurements
correct the schedule.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
import time
from typing import NamedTuple

from granpinn.training.schedule import Schedule
from granpinn.training.trainer import Trainer

PROBE_SECONDS = 0.7  # time to measure each kind of step
WARM_UP = 2  # first steps, which are slower and do not count
MARGIN = 1.02  # expected time over measured time
WORTHWHILE = 0.02  # smallest relative change of the steps left that changes the schedule
MOST_KEPT = 0.6  # largest part of a run that is kept for what follows the training


class Limit(NamedTuple):
    """When a run has to end, and what of its time is kept for what follows the training.

    Attributes:
        until: value of time.monotonic() at the end of the run.
        seconds: of the whole run.
        later: seconds for more training (uncertainty/sensitivity.py).
        steps: so many steps take as long as the steps in the last layer, which come next.
        after: seconds for everything else.
    """

    until: float
    seconds: float
    later: float = 0.0
    steps: float = 0.0
    after: float = 0.0

    def deadline(self, pace: float = 0.0) -> float:
        """The end of the training, if a step takes `pace` seconds."""
        kept = self.steps * pace + self.after
        return self.until - self.later - min(kept, MOST_KEPT * self.seconds)


def schedule_within(limit: Limit, trainer: Trainer, at_most: int) -> Schedule:
    """The schedule of a new run that ends within a limit."""
    schedule = trainer.schedule
    prefit = schedule.settings.prefit
    pace = sum(
        part * _pace(trainer, in_prefit)
        for in_prefit, part in ((True, prefit), (False, 1 - prefit))
        if part > 0
    )
    return Schedule(_steps(limit, pace, at_most), schedule.settings)


def corrected(trainer: Trainer, since: tuple[int, float], limit: Limit, at_most: int) -> Schedule:
    """The schedule that ends within a limit, from the pace since (step, clock) `since`."""
    schedule, step = trainer.schedule, trainer.step
    pace = (time.monotonic() - since[1]) / (step - since[0])
    total = step + _steps(limit, pace, at_most - step)
    if abs(total - schedule.total) < WORTHWHILE * (schedule.total - step):
        return schedule
    return schedule.ending_at(total, step)


def _steps(limit: Limit, pace: float, at_most: int) -> int:
    seconds = limit.deadline(pace) - time.monotonic()
    return max(1, min(at_most, math.floor(seconds / (MARGIN * pace))))


def _pace(trainer: Trainer, prefit: bool) -> float:
    """Median seconds of a step of the pre-fit, or of a later one; restores the state."""
    schedule = trainer.schedule
    settings = dataclasses.replace(schedule.settings, prefit=float(prefit))
    trainer.schedule = Schedule(10**9, settings)
    trainer.remember()
    times: list[float] = []
    begin = time.monotonic()
    while len(times) < WARM_UP + 3 or time.monotonic() - begin < PROBE_SECONDS:
        start, before = time.monotonic(), trainer.step
        trainer.advance()
        times.append((time.monotonic() - start) / (trainer.step - before))
    trainer.restore()
    trainer.schedule = schedule
    return statistics.median(times[WARM_UP:])
