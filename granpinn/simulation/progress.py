"""Lines about the progress of a simulation."""

from __future__ import annotations

import time
from collections.abc import Callable

from granpinn.simulation.engine import StepReport
from granpinn.terminal import say

LINE_EVERY = 10.0  # seconds


def lines(
    t_end: float, say: Callable[[str], None] = say, every: float = LINE_EVERY
) -> Callable[[StepReport], None]:
    """A listener that says a line every ten seconds, by default to stderr."""
    begin = said = time.monotonic()

    def show(report: StepReport) -> None:
        nonlocal said
        now = time.monotonic()
        if now - said < every:
            return
        said = now
        left = (now - begin) / report.time * (t_end - report.time)
        say(
            f"t {report.time:.3g}/{t_end:.3g}  dt {report.step:.2g}  iterations "
            f"{report.viscous_iterations}+{report.pressure_iterations}  window "
            f"{report.window[0]}x{report.window[1]}  {left:.0f} s left"
        )

    return show
