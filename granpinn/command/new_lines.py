"""The answer of a run in the terminal: each line as soon as it is known."""

from __future__ import annotations

import dataclasses
from itertools import takewhile

from granpinn.results import Result
from granpinn.results.attempt import PENDING


class NewLines:
    """Prints results of one run that grow: only lines that were not printed before.

    Parts that are still pending have no line, nor has the assessment, which they may change. Later
    rows of the table get its heading again.
    """

    def __init__(self) -> None:
        self._printed: set[str] = set()

    def show(self, result: Result) -> None:
        """Print the lines of a result that are new."""
        made = {name: why for name, why in result.not_done.items() if why != PENDING}
        heading, *lines, _ = dataclasses.replace(result, not_done=made).summary().splitlines()
        table = set(takewhile(lambda line: len(line) == len(heading), lines))
        # Columns may be wider than before.
        new = [line for line in lines if " ".join(line.split()) not in self._printed]
        if table.intersection(new):
            print(heading)
        for line in new:
            print(line, flush=True)
        self._printed.update(" ".join(line.split()) for line in new)
