"""A run with a time limit: how many steps fit into it.

The number of steps is planned before the first one, from the measured time of a few, so that the
learning rate is annealed to its end when the time is up; the plan is corrected on the way.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
import time

from granpinn.training.schedule import Schedule
from granpinn.training.training import Training

PROBE_SECONDS = 0.7  # time to measure each kind of step
WARM_UP = 2  # first steps, which are slower and do not count
MARGIN = 1.02  # planned time over measured time
WORTHWHILE = 0.02  # smallest relative change of the steps left that is worth a new plan


def plan(training: Training, deadline: float, at_most: int) -> Schedule:
    """The schedule of a run that has not begun, up to time.monotonic() == `deadline`."""
    schedule = training.schedule
    prefit = schedule.settings.prefit
    pace = sum(
        weight * _pace(training, alone)
        for alone, weight in ((True, prefit), (False, 1 - prefit))
        if weight > 0
    )
    (total,) = training.processes.first([_steps(deadline, pace, at_most)])
    return Schedule(int(total), schedule.settings)


def corrected(
    training: Training, since: tuple[int, float], deadline: float, at_most: int
) -> Schedule:
    """The schedule that ends at `deadline`, from the pace since (step, clock) `since`."""
    schedule, step = training.schedule, training.step
    pace = (time.monotonic() - since[1]) / (step - since[0])
    total = step + _steps(deadline, pace, at_most - step)
    if abs(total - schedule.total) < WORTHWHILE * (schedule.total - step):
        return schedule
    return schedule.replanned(step, total)


def _steps(deadline: float, pace: float, at_most: int) -> int:
    seconds = deadline - time.monotonic()
    return max(1, min(at_most, math.floor(seconds / (MARGIN * pace))))


def _pace(training: Training, velocity_alone: bool) -> float:
    """Median seconds of a step of one kind; the state is as before."""
    schedule = training.schedule
    settings = dataclasses.replace(schedule.settings, prefit=float(velocity_alone))
    training.schedule = Schedule(10**9, settings)
    training.remember()
    times: list[float] = []
    begin = time.monotonic()
    while any(
        training.processes.first(
            [len(times) < WARM_UP + 3, time.monotonic() - begin < PROBE_SECONDS]
        )
    ):
        start, before = time.monotonic(), training.step
        training.advance()
        times.append((time.monotonic() - start) / (training.step - before))
    training.restore()
    training.schedule = schedule
    return statistics.median(times[WARM_UP:])
