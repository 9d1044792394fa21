"""The schedule: length of a run, stages and learning rate, as pure functions of the step.

The host computes the rows of the next steps and copies them to the device once, as the control
table. A step reads its row by the step counter, which is on the device too. So a step moves no
number between host and device, and a captured CUDA graph holds no number that a later step changes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from granpinn.arrays import Float64
from granpinn.config import Config, Optimizer

PREFIT_FINAL = 0.1  # learning rates at the end of the pre-fit, relative to their peak


@dataclass(frozen=True)
class Schedule:
    """A run of `total` steps: first the pre-fit of the velocity alone, then the whole loss.

    Step s is in [0, total). Everything depends on the progress in [0, 1], which is linear in the
    step. A run with a time limit may change its total on the way: progress then continues from
    (from_step, from_progress) to 1 at the new total, without a jump.

    Attributes:
        settings: learning rates and fractions of the run.
    """

    total: int
    settings: Optimizer
    from_step: int = 0
    from_progress: float = 0.0

    def progress(self, step: int) -> float:
        """Part of the run that is done before step `step`."""
        done = (step - self.from_step) / max(1, self.total - self.from_step)
        return self.from_progress + (1 - self.from_progress) * done

    def ending_at(self, total: int, step: int) -> Schedule:
        """The schedule that continues from `step` and ends at `total`."""
        progress = self.progress(step)
        return dataclasses.replace(self, total=total, from_step=step, from_progress=progress)

    def in_prefit(self, step: int) -> bool:
        """Whether step `step` belongs to the pre-fit of the velocity."""
        return self.progress(step) < self.settings.prefit

    def ends_prefit(self, step: int) -> bool:
        """Whether step `step` is the first one after a pre-fit."""
        return step > 0 and self.in_prefit(step - 1) and not self.in_prefit(step)

    def stage(self, step: int) -> tuple[float, float]:
        """Parts of the present stage that are done before and after `step`, each in [0, 1]."""
        prefit = self.settings.prefit
        begin, end = (0.0, prefit) if self.in_prefit(step) else (prefit, 1.0)
        before, after = ((self.progress(i) - begin) / (end - begin) for i in (step, step + 1))
        return before, min(1.0, after)

    def learning_rate(self, step: int) -> float:
        """Factor in [0, 1] on every learning rate: in each stage from 0 up, then linearly down."""
        s = self.settings
        final = PREFIT_FINAL if self.in_prefit(step) else s.final_fraction
        done, after = self.stage(step)
        if done < s.warm_up:
            return min(1.0, after / s.warm_up)
        decayed = (done - s.warm_up) / (1 - s.warm_up)
        return final + (1 - final) * (1 - decayed)


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


class ControlTable:
    """Tensors on the device that control the steps of E members.

    Args:
        velocity_factors: of every member, `Problem.velocity_factor`.

    Attributes:
        table: [ROWS, 1 + E] float64: factor on the learning rates, and on the weight of the
            velocity term of each member.
        counter: int64 [3]: step, step of the table's first row, and 0 (used by the update).
        lr_scale: float64 [E], a factor on the learning rates of a member.
        fault: int64 [E], code of the first fault of a member; HEALTHY without one.
        stretch: number of rows that are computed at once.
    """

    def __init__(
        self, velocity_factors: Sequence[VelocityFactor], config: Config, device: torch.device
    ) -> None:
        E = len(velocity_factors)
        self.table = torch.zeros(ROWS, 1 + E, dtype=torch.float64, device=device)
        self.counter = torch.zeros(3, dtype=torch.int64, device=device)
        self.lr_scale = torch.ones(E, dtype=torch.float64, device=device)
        self.fault = torch.full((E,), HEALTHY, dtype=torch.int64, device=device)
        self.stretch = min(ROWS, config.log_every)
        self._velocity_factors = list(velocity_factors)
        self._loaded: tuple[object, ...] | None = None  # inputs of the rows on the device
        self._first = self._next = 0  # step of the first row, and step of the counter
        self._rows = np.empty((0, 1 + E))
        self._ahead: tuple[tuple[object, ...], Float64] | None = None

    def prepare(
        self,
        schedule: Schedule,
        step: int,
        misfit: Sequence[float],
        steps: int,
        lr_scale: Sequence[float],
        diverged: Collection[int],
    ) -> None:
        """Make the device ready for `steps` steps from `step` on.

        Args:
            misfit: rms velocity misfit of every member after the pre-fit.
            diverged: members that stay frozen.
        """
        depends = (schedule, tuple(misfit), tuple(lr_scale), tuple(diverged))
        ready = self._loaded == depends and self._next == step
        if not ready or step + steps > self._first + len(self._rows):
            self._rows, self._first = self.rows(schedule, step, misfit), step
            self.table[: len(self._rows)].copy_(torch.from_numpy(self._rows))
            self.counter.copy_(torch.tensor([step, step, 0]))
        if not ready:
            self._loaded = depends
            self.lr_scale.copy_(torch.tensor(lr_scale, dtype=torch.float64))
            frozen = torch.full((len(lr_scale),), HEALTHY)
            frozen[list(diverged)] = 0
            self.fault.copy_(frozen)
        self._next = step + steps

    def rows(self, schedule: Schedule, step: int, misfit: Sequence[float]) -> Float64:
        """The rows [stretch, 1 + E] from `step` on; those of the last call are kept."""
        at = (schedule, step, tuple(misfit))
        if self._ahead is not None and self._ahead[0] == at:
            return self._ahead[1]
        rows = np.ones((self.stretch, 1 + len(self._velocity_factors)))
        pairs = zip(self._velocity_factors, misfit, strict=True)
        factors = [factor(value) for factor, value in pairs]
        for k, row in enumerate(rows, start=step):
            row[0] = schedule.learning_rate(k)
            if not schedule.in_prefit(k):
                row[1:] = factors
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
