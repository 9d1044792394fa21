"""The schedule: length of a run, stages and learning rate, as pure functions of the step."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from granpinn.config import Optimizer


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

    def averages(self, step: int) -> bool:
        """Whether the parameters after step `step` enter the average."""
        return self.progress(step) >= 1 - self.settings.average

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
        final = s.prefit_final_fraction if self.in_prefit(step) else s.final_fraction
        done, after = self.stage(step)
        if done < s.warm_up:
            return min(1.0, after / s.warm_up)
        decayed = (done - s.warm_up) / (1 - s.warm_up)
        return final + (1 - final) * (1 - decayed)
