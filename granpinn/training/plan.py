"""Keeps the control table on the device ahead of the steps.

The rows are those of the present schedule; they are computed again when it is another one, or the
members' learning rates are, and while a GPU is busy for the next stretch.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from granpinn.config import Config
from granpinn.training.control import ROWS, Control
from granpinn.training.problem import velocity_relaxation
from granpinn.training.schedule import Schedule

Rows = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """What the rows from a step on depend on, besides the settings.

    Attributes:
        averaged: how many steps before it have entered the running average.
        misfit: of every member after the pre-fit.
    """

    schedule: Schedule
    step: int
    averaged: int
    misfit: tuple[float, ...]


class Plan:
    """The rows of the control table, in stretches.

    Attributes:
        step: the step that the device is at, None if it has to be told anew.
        stretch: most steps that the table is ready for at once.
    """

    def __init__(self, control: Control, config: Config, velocity_weights: Sequence[float]) -> None:
        self.control = control
        self.settings = config.weights
        self.velocity_weights = list(velocity_weights)
        self.stretch = min(ROWS, config.log_every)
        self.step: int | None = None
        self._loaded: tuple[object, ...] | None = None
        self._first = 0
        self._rows = np.empty((0, 2 + len(self.velocity_weights)))
        self._ahead: tuple[Place, Rows] | None = None

    def ready(
        self, place: Place, steps: int, slower: Sequence[float], lost: Collection[int]
    ) -> Rows:
        """Make the device ready for the steps from `place` on; their rows [steps, 2 + E]."""
        for_whom = (place.schedule, tuple(slower), tuple(lost))
        begin = place.step - self._first
        if self.step != place.step or self._loaded != for_whom or begin + steps > len(self._rows):
            self._rows = self.rows(place)
            self.control.load(place.step, self._rows, slower, lost)
            self._loaded, self._first, begin = for_whom, place.step, 0
        self.step = place.step + steps
        return self._rows[begin : begin + steps]

    def rows(self, place: Place) -> Rows:
        """The rows [stretch, 2 + E] from `place` on; they are remembered for its turn."""
        if self._ahead is not None and self._ahead[0] == place:
            return self._ahead[1]
        schedule, averaged = place.schedule, place.averaged
        rows = np.ones((self.stretch, 2 + len(self.velocity_weights)))
        for step, row in enumerate(rows, start=place.step):
            row[0] = schedule.learning_rate(step)
            averages = schedule.averages(step)
            averaged += averages
            row[1] = 1 / averaged if averages else 0.0
            if not schedule.velocity_alone(step):
                done, _ = schedule.stage(step)
                row[2:] = velocity_relaxation(
                    self.settings, self.velocity_weights, place.misfit, done
                )
        self._ahead = (place, rows)
        return rows
