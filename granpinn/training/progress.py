"""The progress of a run: a bar in a terminal or a notebook, plain lines elsewhere, events for
TensorBoard.

A run calls its listener: `start`, then `show` for every row of the history, then `stop`.
"""

from __future__ import annotations

import math
import sys
import time
from html import escape
from pathlib import Path
from typing import Any, TextIO

from granpinn.config import ConfigError
from granpinn.output import naming
from granpinn.physics.terms import TERMS
from granpinn.terminal import visible
from granpinn.training.history import Row

LINE_EVERY = 10.0  # seconds between plain lines
UPDATE_EVERY = 0.5  # seconds between updates in a notebook


class Progress:
    """A listener of a run; subclass it and override what is of interest."""

    def start(self, total: int, done: int) -> None:
        """A run of `total` steps begins; `done` of them are in a checkpoint."""

    def total(self, steps: int) -> None:
        """The schedule changed: the run has this many steps."""

    def show(self, row: Row) -> None:
        """A row was added to the history."""

    def message(self, text: str) -> None:
        """Show a sentence about an event of the run."""

    def stop(self) -> None:
        """The run ended, with or without an error."""


class Silent(Progress):
    """Shows nothing."""


class Lines(Silent):
    """One line every ten seconds, for log files."""

    def __init__(self, stream: TextIO | None = None, every: float = LINE_EVERY) -> None:
        self.stream = stream or sys.stderr
        self.every = every
        self.last = -math.inf

    def start(self, total: int, done: int) -> None:
        self.steps, self.done = total, done
        self.begin = time.monotonic()

    def total(self, steps: int) -> None:
        self.steps = steps

    def show(self, row: Row) -> None:
        now = time.monotonic()
        if now - self.last < self.every and row.step < self.steps:
            return
        self.last = now
        left = (now - self.begin) / max(1, row.step - self.done) * (self.steps - row.step)
        self.message(f"step {row.step}/{self.steps}  {describe(row)}  {duration(left)} left")

    def message(self, text: str) -> None:
        print(visible(text), file=self.stream, flush=True)


class Bar(Silent):
    """A bar with the time left; below it the identified values and the loss terms. By rich."""

    def __init__(self) -> None:
        from rich import progress
        from rich.console import Console
        from rich.live import Live

        columns = (
            progress.TextColumn("step"),
            progress.MofNCompleteColumn(),
            progress.BarColumn(),
            progress.TimeRemainingColumn(),
            progress.TextColumn("left"),
        )
        self.bar = progress.Progress(*columns)
        self.live = Live(self.bar, console=Console(stderr=True))

    def start(self, total: int, done: int) -> None:
        self.task = self.bar.add_task("", total=total, completed=done)
        self.live.start()

    def total(self, steps: int) -> None:
        self.bar.update(self.task, total=steps)

    def show(self, row: Row) -> None:
        from rich.console import Group
        from rich.text import Text

        self.bar.update(self.task, completed=row.step)
        self.live.update(Group(self.bar, Text(describe(row))))

    def message(self, text: str) -> None:
        self.live.console.print(visible(text), markup=False, highlight=False)

    def stop(self) -> None:
        self.live.stop()


class Notebook(Silent):
    """One line with a bar in the output of a notebook cell, updated in place. By IPython."""

    def __init__(self, every: float = UPDATE_EVERY) -> None:
        from IPython import display

        self.display: Any = display.display
        self.every = every
        self.last = -math.inf
        self.handle: Any = None
        self.text = ""

    def start(self, total: int, done: int) -> None:
        self.steps, self.step, self.done = total, done, done
        self.begin = time.monotonic()
        self.handle = self.display(self._content(), raw=True, display_id=True)

    def total(self, steps: int) -> None:
        self.steps = steps

    def show(self, row: Row) -> None:
        now = time.monotonic()
        left = (now - self.begin) / max(1, row.step - self.done) * (self.steps - row.step)
        self.step = row.step
        self.text = f"  {describe(row)}  {duration(left)} left"
        if now - self.last >= self.every:
            self.last = now
            self._update()

    def message(self, text: str) -> None:
        print(text, flush=True)

    def stop(self) -> None:
        if self.handle is not None:
            self.text = self.text.rpartition("  ")[0] if self.step >= self.steps else self.text
            self._update()

    def _update(self) -> None:
        self.handle.update(self._content(), raw=True)

    def _content(self) -> dict[str, str]:
        line = f"step {self.step}/{self.steps}{self.text}"
        bar = f'<progress value="{self.step}" max="{self.steps}"></progress>'
        return {"text/plain": line, "text/html": f"{bar} {escape(line)}"}


class TensorBoard(Silent):
    """Writes events for TensorBoard, if it is installed, and calls the listener `inner` too."""

    def __init__(self, folder: Path, inner: Progress) -> None:
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:
            raise ConfigError(
                "--tensorboard needs the package tensorboard: pip install granpinn[tensorboard]"
            ) from None
        self.make_writer: Any = SummaryWriter
        self.writer: Any = None
        self.folder = folder / "tensorboard"
        self.inner = inner

    def start(self, total: int, done: int) -> None:
        with naming(self.folder):
            self.writer = self.make_writer(str(self.folder))
        self.inner.start(total, done)

    def total(self, steps: int) -> None:
        self.inner.total(steps)

    def show(self, row: Row) -> None:
        with naming(self.folder):
            for name, value in row.values().items():
                if name != "step" and math.isfinite(value):
                    self.writer.add_scalar(name, value, row.step)
        self.inner.show(row)

    def message(self, text: str) -> None:
        self.inner.message(text)

    def stop(self) -> None:
        if self.writer is not None:
            with naming(self.folder):
                self.writer.close()
        self.inner.stop()


def automatic() -> Progress:
    """A bar in a terminal, lines otherwise."""
    return Bar() if sys.stderr.isatty() else Lines()


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
