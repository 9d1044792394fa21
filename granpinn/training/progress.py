"""The progress of a run: a bar in a terminal or a notebook, plain lines elsewhere.

A run calls its listener: `plan`, `start`, then `show` for every row of the history, `stop`; then
`stage` for everything that follows, and `stop` again.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple

from granpinn.physics.terms import TERMS
from granpinn.terminal import visible
from granpinn.training.history import Row

LAST_LAYER = "last layer"  # the stage that ends a training


class Stage(NamedTuple):
    """What follows a training, and the time that it is expected to take.

    Attributes:
        seconds: on two idle cores.
        steps: in addition, in steps of the training.
        share: in addition, of the time of the training.
    """

    name: str
    seconds: float = 0.0
    steps: float = 0.0
    share: float = 0.0


class Progress:
    """A listener of a run; subclass it and override what is of interest."""

    def plan(self, stages: Sequence[Stage], until: float | None) -> None:
        """These stages follow the training; time.monotonic() is `until` at their end.

        None: there is no time limit.
        """

    def start(self, total: int, done: int) -> None:
        """A training of `total` steps begins; `done` of them are in a checkpoint."""

    def total(self, steps: int) -> None:
        """The schedule changed: the training has this many steps."""

    def show(self, row: Row) -> None:
        """A row was added to the history."""

    def stage(self, name: str) -> None:
        """A later stage begins."""

    def message(self, text: str) -> None:
        """Show a sentence about an event of the run."""

    def stop(self) -> None:
        """The training, or the last stage, ended, with or without an error."""


class Silent(Progress):
    """Shows nothing."""


class Shown(Silent):
    """Knows the stage and the time left of the whole run; a subclass shows them in `update`.

    Args:
        last: stages that follow those of `plan`, such as the figures of a command.

    Attributes:
        every: seconds between updates.
    """

    every = 0.5

    def __init__(self, last: Sequence[Stage] = ()) -> None:
        self.updated = -math.inf
        self.later = [*last]
        self.until: float | None = None
        self.stages: list[tuple[Stage, float]] = []  # the present one, with its first moment
        self.name, self.text = "fit", ""
        self.times: list[tuple[int, float]] = []  # while it trains: steps and their moments
        self.first: float | None = None
        self.fit = self.pace = 0.0  # seconds of the training, and of a step

    def plan(self, stages: Sequence[Stage], until: float | None) -> None:
        last = sum(stage.seconds for stage in self.later)
        self.until = None if until is None else until + last
        self.later = [*stages, *self.later]

    def start(self, total: int, done: int) -> None:
        now = time.monotonic()
        self.first = now if self.first is None else self.first
        self.steps, self.times = total, [(done, now)]
        self.name = self.name if self.stages else "fit"
        self.update()

    def total(self, steps: int) -> None:
        self.steps = steps

    def show(self, row: Row) -> None:
        now = time.monotonic()
        self.times.append((row.step, now))
        self._measure()
        self.text = describe(row)
        if row.step >= self.steps or now - self.updated >= self.every:
            self.updated = now
            self.update()

    def stage(self, name: str) -> None:
        now = time.monotonic()
        self.first = now if self.first is None else self.first
        place = next((k for k, stage in enumerate(self.later) if stage.name == name), None)
        self.stages = []
        if place is not None:
            self.stages, self.later = [(self.later[place], now)], self.later[place + 1 :]
        self.name, self.times = name, []
        self.update()

    def stop(self) -> None:
        self.times = []
        if not self.later:
            self.name, self.stages = "done", []

    def update(self) -> None:
        """Show `line`, `done` and `left`."""

    @property
    def where(self) -> str:
        """The stage, with the step of a training."""
        times = self.times  # rich looks from another thread
        return f"{self.name} {times[-1][0]}/{self.steps}" if times else self.name

    @property
    def line(self) -> str:
        """Everything in one line."""
        return "  ".join(part for part in (self.where, self.text, self.words) if part)

    @property
    def words(self) -> str:
        """The time left, where a step shows it."""
        return f"{duration(self.left)} left" if self.pace and self.name != "done" else ""

    @property
    def done(self) -> float:
        """The part of the time of the whole run that has passed."""
        if self.first is None or not self.pace:
            return 0.0
        passed = time.monotonic() - self.first
        return passed / max(passed + self.left, 1e-9)

    @property
    def left(self) -> float:
        """The expected seconds to the end of the last stage."""
        now, times, training = time.monotonic(), self.times, 0.0
        if times:
            training = max(0.0, self.pace * (self.steps - times[-1][0]) - (now - times[-1][1]))
        left = training + sum(map(self._expected, self.later))
        for stage, begun in () if times else self.stages:
            left += max(0.0, self._expected(stage) - (now - begun))
        return left if self.until is None else min(left, max(0.0, self.until - now))

    def _measure(self) -> None:
        """The pace of the training."""
        step, moment = self.times[-1]
        # Steps of the pre-fit are quicker: the later half of the steps shows the pace.
        middle = (self.times[0][0] + step) // 2
        since = next(row for row in reversed(self.times[:-1]) if row[0] <= middle)
        passed = max(moment - since[1], 1e-9)
        self.pace = passed / max(1, step - since[0])
        self.fit = moment - self.times[0][1] + self.pace * (self.steps - step)

    def _expected(self, stage: Stage) -> float:
        """The expected seconds of a stage."""
        return stage.seconds + stage.steps * self.pace + stage.share * self.fit


class Lines(Shown):
    """One line every ten seconds, for log files."""

    every = 10.0

    def update(self) -> None:
        if self.times[1:] or not self.times:
            self.message(self.line)

    def message(self, text: str) -> None:
        print(visible(text), file=sys.stderr, flush=True)


class Bar(Shown):
    """A bar with the stage and the time left; below it values and loss terms. By rich."""

    def __init__(self, last: Sequence[Stage] = ()) -> None:
        super().__init__(last)
        from rich import progress
        from rich.console import Console
        from rich.live import Live

        columns = ("{task.description}", progress.BarColumn(), "{task.fields[left]}")
        self.bar = progress.Progress(*columns)
        self.task = self.bar.add_task("", total=1.0, left="")
        console = Console(stderr=True)
        self.live = Live(get_renderable=self._content, console=console, transient=True)

    def update(self) -> None:
        self.live.start()  # a stage may follow `stop`

    def _content(self) -> Any:
        """The bar of this moment: rich shows it several times a second, in a stage too."""
        from rich.console import Group
        from rich.text import Text

        self.bar.update(self.task, description=self.where, completed=self.done, left=self.words)
        return Group(self.bar, Text(self.text))

    def message(self, text: str) -> None:
        self.live.console.print(visible(text), markup=False, highlight=False)

    def stop(self) -> None:
        super().stop()
        self.live.stop()


class Notebook(Shown):
    """One line with a bar in the output of a notebook cell, updated in place. By IPython."""

    def __init__(self) -> None:
        super().__init__()
        from IPython import display

        self.display: Any = display.display
        self.handle: Any = None

    def update(self) -> None:
        if self.handle is None:
            self.handle = self.display(self._content(), raw=True, display_id=True)
        else:
            self.handle.update(self._content(), raw=True)

    def message(self, text: str) -> None:
        print(text, flush=True)

    def stop(self) -> None:
        super().stop()
        if self.handle is not None:
            self.update()

    def _content(self) -> dict[str, str]:
        line = self.line
        bar = f'<progress value="{self.done:.3f}" max="1"></progress>'
        return {"text/plain": line, "text/html": f"{bar} {escape(line)}"}


def automatic(last: Sequence[Stage] = ()) -> Progress:
    """A bar in a terminal, lines otherwise; `last`: stages that follow the identification."""
    return Bar(last) if sys.stderr.isatty() else Lines(last)


def by_default() -> Progress:
    """A line with a bar in a notebook, nothing elsewhere."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    # The application of a kernel: IPython in a terminal has none.
    return Notebook() if "IPKernelApp" in getattr(shell, "config", {}) else Silent()


def describe(row: Row) -> str:
    """The free parameters, the loss and its terms in one line, without the unused terms."""
    values = row.values()
    parts = [f"{name} {values[name]:.4f}" for name in row.law.free] + [f"loss {row.loss:.3g}"]
    terms = zip(TERMS, row.terms, strict=True)
    return "  ".join(parts + [f"{term.label} {v:.1e}" for term, v in terms if math.isfinite(v)])


def duration(seconds: float) -> str:
    """3723 s as 1:02:03, 65 s as 1:05."""
    minutes, s = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{s:02d}" if hours else f"{minutes}:{s:02d}"
