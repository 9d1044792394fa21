"""The control table: the schedule of the next steps, on the device.

The schedule is a pure function of the step, in Python. The host computes the rows of the next
steps and copies them to the device once. A step reads its row by the step counter, which is on the
device too. So a step moves no number between host and device, and a captured CUDA graph holds no
number that a later step changes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np
import torch

from granpinn.arrays import Float64
from granpinn.config import Config
from granpinn.training.schedule import Schedule

VelocityFactor = Callable[[float], float]  # of the misfit after the pre-fit
ROWS = 256
HEALTHY = torch.iinfo(torch.int64).max
FAULTS = (
    "loss",
    "gradient of the network parameters",
    "gradient of the friction law",
    "network parameters",
    "variables of the friction law",
)
_CODES = 8  # csrc/step.h: fault = step * 8 + index into FAULTS


class Position(NamedTuple):
    """A place in the schedule; it determines the rows from `step` on.

    Attributes:
        averaged: number of steps before `step` that are in the running average.
        misfit: rms velocity misfit of every member after the pre-fit.
    """

    schedule: Schedule
    step: int
    averaged: int
    misfit: tuple[float, ...]


class ControlTable:
    """Tensors on the device that control the steps of E members.

    Args:
        velocity_factors: of every member, `Problem.velocity_factor`.

    Attributes:
        table: [ROWS, 2 + E] float64: factor on the learning rates, weight of the parameters in
            their running average, factor on the weight of each member's velocity term.
        counter: int64 [3]: step, step of the table's first row, and 0 (used by the update).
        lr_scale: float64 [E], a factor on the learning rates of a member.
        fault: int64 [E], code of the first fault of a member; HEALTHY without one.
        stretch: number of rows that are computed at once.
    """

    def __init__(
        self, velocity_factors: Sequence[VelocityFactor], config: Config, device: torch.device
    ) -> None:
        E = len(velocity_factors)
        self.table = torch.zeros(ROWS, 2 + E, dtype=torch.float64, device=device)
        self.counter = torch.zeros(3, dtype=torch.int64, device=device)
        self.lr_scale = torch.ones(E, dtype=torch.float64, device=device)
        self.fault = torch.full((E,), HEALTHY, dtype=torch.int64, device=device)
        self.stretch = min(ROWS, config.log_every)
        self._velocity_factors = list(velocity_factors)
        self._loaded: tuple[object, ...] | None = None  # inputs of the rows on the device
        self._first = self._next = 0  # step of the first row, and step of the counter
        self._rows = np.empty((0, 2 + E))
        self._ahead: tuple[Position, Float64] | None = None

    def prepare(
        self, at: Position, steps: int, lr_scale: Sequence[float], diverged: Collection[int]
    ) -> Position:
        """Make the device ready for `steps` steps from `at` on; the position after them.

        Members in `diverged` stay frozen.
        """
        depends = (at.schedule, at.misfit, tuple(lr_scale), tuple(diverged))
        ready = self._loaded == depends and self._next == at.step
        if not ready or at.step + steps > self._first + len(self._rows):
            self._rows, self._first = self.rows(at), at.step
            self.table[: len(self._rows)].copy_(torch.from_numpy(self._rows))
            self.counter.copy_(torch.tensor([at.step, at.step, 0]))
        if not ready:
            self._loaded = depends
            self.lr_scale.copy_(torch.tensor(lr_scale, dtype=torch.float64))
            frozen = torch.full((len(lr_scale),), HEALTHY)
            frozen[list(diverged)] = 0
            self.fault.copy_(frozen)
        self._next = at.step + steps
        used = self._rows[at.step - self._first : self._next - self._first]
        averaged = at.averaged + int(np.count_nonzero(used[:, 1]))
        return at._replace(step=self._next, averaged=averaged)

    def rows(self, at: Position) -> Float64:
        """The rows [stretch, 2 + E] from `at` on; those of the last call are kept."""
        if self._ahead is not None and self._ahead[0] == at:
            return self._ahead[1]
        rows, averaged = np.ones((self.stretch, 2 + len(self._velocity_factors))), at.averaged
        pairs = zip(self._velocity_factors, at.misfit, strict=True)
        factors = [factor(misfit) for factor, misfit in pairs]
        for step, row in enumerate(rows, start=at.step):
            row[0] = at.schedule.learning_rate(step)
            averages = at.schedule.averages(step)
            averaged += averages
            row[1] = 1 / averaged if averages else 0.0
            if not at.schedule.in_prefit(step):
                row[2:] = factors
        self._ahead = (at, rows)
        return rows

    def faults(self) -> dict[int, str]:
        """Member: "the loss became NaN or infinite in step 24", for members with a fault."""
        codes = self.fault.tolist()
        return {e: _sentence(code) for e, code in enumerate(codes) if code != HEALTHY}

    def reload(self) -> None:
        """Load everything anew before the next step, which clears the faults."""
        self._loaded = None


def _sentence(fault: int) -> str:
    step, what = divmod(fault, _CODES)
    return f"the {FAULTS[what]} became NaN or infinite in step {step + 1}"
