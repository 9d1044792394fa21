"""Progress of a simulation: a bar in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from granpinn.simulation.engine import StepReport
from granpinn.terminal import say

REFRESH = 0.2  # seconds between updates of the bar
LINE_EVERY = 10.0  # seconds between plain lines


class SilentSimulation:
    """A listener that shows nothing, and the base of those that show something."""

    def start(self, t_end: float) -> None:
        self.t_end = t_end
        self.begin = time.monotonic()
        self.last = self.begin
        self.steps = 0

    def show(self, report: StepReport) -> None:
        self.steps += 1

    def stop(self) -> None: ...

    def due(self, seconds: float) -> bool:
        """Whether `seconds` have passed since the last call that returned true."""
        now = time.monotonic()
        if now - self.last < seconds:
            return False
        self.last = now
        return True


class SimulationLines(SilentSimulation):
    """One line every ten seconds, for log files.

    Args:
        say: takes a line; by default it goes to stderr.
    """

    def __init__(self, say: Callable[[str], None] = say, every: float = LINE_EVERY) -> None:
        self.say = say
        self.every = every

    def show(self, report: StepReport) -> None:
        super().show(report)
        if not self.due(self.every):
            return
        passed = time.monotonic() - self.begin
        left = passed / report.time * (self.t_end - report.time)
        self.say(f"t {report.time:.3g}/{self.t_end:.3g}  {describe(report)}  {left:.0f} s left")


class SimulationBar(SilentSimulation):
    """A bar with the time, the step, the iterations of both solves and the time left, by rich."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            BarColumn(bar_width=20),
            TextColumn("t {task.completed:.3g}/{task.total:.3g}"),
            TimeRemainingColumn(),
            TextColumn("{task.description}"),
        )
        self.bar = Progress(*columns, console=Console(stderr=True))

    def start(self, t_end: float) -> None:
        super().start(t_end)
        self.task = self.bar.add_task("", total=t_end)
        self.bar.start()

    def show(self, report: StepReport) -> None:
        super().show(report)
        if self.due(REFRESH):
            self.bar.update(self.task, completed=report.time, description=describe(report))

    def stop(self) -> None:
        self.bar.stop()


def automatic() -> SilentSimulation:
    """A bar if the error output is a terminal, else lines."""
    return SimulationBar() if sys.stderr.isatty() else SimulationLines()


def describe(report: StepReport) -> str:
    """Time step, iterations and window of a report, as text."""
    return (
        f"dt {report.step:.2g}  iterations {report.viscous_iterations}+"
        f"{report.pressure_iterations}  window {report.window[0]}x{report.window[1]}"
    )
