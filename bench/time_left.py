"""The time left that a run shows, against what it then took.

python -m bench.time_left NAME FLOW.h5 [OPTIONS OF TRAIN] >> bench/results/time_left.csv

A row is one update: name, seconds since the training began, stage, step, seconds left as shown,
seconds left in truth, CPU seconds of the process.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Sequence
from tempfile import TemporaryDirectory

from granpinn.command import training_run
from granpinn.commands.train import parse
from granpinn.training import progress
from granpinn.training.progress import Shown, Stage

COLUMNS = ("run", "seconds", "stage", "step", "left_s", "true_s", "cpu_s")


class Log(Shown):
    """Keeps every update."""

    def __init__(self, last: Sequence[Stage]) -> None:
        super().__init__(0.0, last)
        self.rows: list[tuple[float, str, int, float, float]] = []

    def update(self) -> None:
        left, step = self.left, self.times[-1][0] if self.times else self.steps
        now = time.monotonic() - (self.first or 0.0)
        self.rows.append((now, self.name, step, left, time.process_time()))


def main(words: Sequence[str]) -> int:
    """Runs `train` with a listener that keeps the time left."""
    name, *options = words
    logs: list[Log] = []

    def automatic(last: Sequence[Stage] = ()) -> Log:
        logs.append(Log(last))
        return logs[-1]

    progress.automatic = automatic
    with TemporaryDirectory() as folder:
        config, _ = parse([*options, "--out", f"{folder}/run"])
        sys.stdout, stdout = sys.stderr, sys.stdout
        training_run.run(config)
        sys.stdout = stdout
        end = time.monotonic() - (logs[0].first or 0.0)
    table = csv.writer(sys.stdout)
    for now, stage, step, left, cpu in logs[0].rows:
        table.writerow(
            [name, f"{now:.1f}", stage, step, f"{left:.1f}", f"{end - now:.1f}", f"{cpu:.1f}"]
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
