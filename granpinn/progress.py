"""The progress of a run: a bar in a terminal or a notebook, plain lines elsewhere.

A run calls its listener: `at` as it gets on, a training also `show` for every row of its history;
`stage` for everything that follows; and `stop` at the end.
"""

from __future__ import annotations

import math
import sys
import time
from html import escape
from typing import Any

from granpinn.terminal import say, visible


class Progress:
    """A listener of a run that shows nothing; subclass it and override what is of interest."""

    def at(self, name: str, done: float, total: float, text: str = "") -> None:
        """Of `total` steps, or of a time, so much is done; at the start of a run 0.

        The total may change on the way. `text` has the numbers of the last step.
        """

    def show(self, row: dict[str, float]) -> None:
        """A row was added to the history of a training."""

    def stage(self, name: str) -> None:
        """A later stage begins."""

    def message(self, text: str) -> None:
        """Show a sentence about an event of the run."""

    def stop(self) -> None:
        """The run ended, with or without an error."""


class Shown(Progress):
    """Knows what is done, and the time left; a subclass shows them in `update`.

    Attributes:
        every: seconds between updates.
        times: what was done at each update, and when; empty in a stage that does not say it.
    """

    every = 0.5

    def __init__(self) -> None:
        self.name, self.text, self.updated = "", "", -math.inf
        self.total = 1.0
        self.times: list[tuple[float, float]] = []

    def at(self, name: str, done: float, total: float, text: str = "") -> None:
        now, begun = time.monotonic(), not self.times
        if begun or done >= total or now - self.updated >= self.every:
            self.name, self.total, self.text = name, total, text
            self.times.append((done, now))
            self.updated = -math.inf if begun else now
            self.update()

    def stage(self, name: str) -> None:
        self.name, self.times = name, []
        self.update()

    def stop(self) -> None:
        self.name, self.times = "done", []

    def update(self) -> None:
        """Show `line`, or `where`, `done` and `left`."""

    @property
    def where(self) -> str:
        """The stage, and how far it is."""
        times = self.times  # rich looks from another thread
        return f"{self.name} {short(times[-1][0])}/{short(self.total)}" if times else self.name

    @property
    def line(self) -> str:
        """Everything in one line."""
        return "  ".join(part for part in (self.where, self.text, self.left) if part)

    @property
    def done(self) -> float:
        """The part that is done."""
        times = self.times
        return times[-1][0] / self.total if times else 1.0

    @property
    def left(self) -> str:
        """The time left, where it is known."""
        times = list(self.times)
        if not times or times[-1][0] <= times[0][0]:
            return ""
        done, moment = times[-1]
        # Steps of the pre-fit are quicker: the later half of what is done shows the pace.
        middle = (times[0][0] + done) / 2
        since = next(row for row in reversed(times[:-1]) if row[0] <= middle)
        pace = (moment - since[1]) / (done - since[0])
        return f"{duration(pace * (self.total - done))} left"


class Lines(Shown):
    """One line every ten seconds, for log files."""

    every = 10.0

    def update(self) -> None:
        if self.times[1:] or not self.times:
            self.message(self.line)

    def message(self, text: str) -> None:
        say(text)


class Bar(Shown):
    """A bar with the stage and the time left; below it values and loss terms. By rich."""

    def __init__(self) -> None:
        super().__init__()
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
        """The bar of this moment: rich shows it several times a second."""
        from rich.console import Group
        from rich.text import Text

        self.bar.update(self.task, description=self.where, completed=self.done, left=self.left)
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


def automatic() -> Progress:
    """A bar in a terminal, lines otherwise."""
    return Bar() if sys.stderr.isatty() else Lines()


def by_default() -> Progress:
    """A line with a bar in a notebook, nothing elsewhere."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    # The application of a kernel: IPython in a terminal has none.
    return Notebook() if "IPKernelApp" in getattr(shell, "config", {}) else Progress()


def short(number: float) -> str:
    """15000 as it is, and three digits of a small number."""
    return f"{number:.3g}" if number < 100 else f"{number:.0f}"


def duration(seconds: float) -> str:
    """3723 s as 1:02:03, 65 s as 1:05."""
    minutes, s = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{s:02d}" if hours else f"{minutes}:{s:02d}"
