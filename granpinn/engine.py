"""What runs the steps of a stretch: plain calls, or captured CUDA graphs that are replayed."""

from __future__ import annotations

from collections.abc import Callable

from granpinn.objective import Evaluation

OneStep = Callable[[bool], Evaluation]


class Eager:
    """Calls the step, one after the other."""

    many = False  # whether a stretch is more than one step

    def __init__(self, one_step: OneStep) -> None:
        self.one_step = one_step

    def run(self, steps: int, velocity_alone: bool) -> Evaluation:
        """Make the steps; what the last one evaluated."""
        for _ in range(steps):
            e = self.one_step(velocity_alone)
        return e
