"""history.csv: one row of loss terms and identified values every so many steps.

The file grows at its end. A checkpoint remembers how long it was, and a resumed run cuts it there:
what the lost steps wrote is written again.
"""

from __future__ import annotations

import contextlib
import csv
import io
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from granpinn.physics.laws import Law
from granpinn.physics.terms import NAMES


@dataclass(frozen=True)
class Row:
    """Values of one step; NaN (an empty cell of the file): not part of this step.

    The terms are those of the batch of this step, without their weights; step counts from 1.
    """

    step: int
    wall_s: float
    loss: float
    velocity: float
    surface: float
    momentum: float
    continuity: float
    constitutive: float
    mu_s: float
    mu_2: float
    I0: float
    learning_rate: float


COLUMNS = tuple(f.name for f in fields(Row))


def columns(law: Law) -> tuple[str, ...]:
    """The columns of history.csv for a friction law."""
    return ("step", "wall_s", "loss", *NAMES, *law.names, "learning_rate")


def median(rows: Sequence[Row]) -> Row:
    """The medians, column by column, of one row of every member."""
    if len(rows) == 1:
        return rows[0]
    columns = zip(*(vars(row).values() for row in rows), strict=True)
    step, *values = (float(np.median(column)) for column in columns)
    return Row(int(step), *values)


class History:
    """The rows of a run, in memory and, where there is a run folder, in its history.csv."""

    def __init__(self, path: Path | None) -> None:
        self.rows: list[Row] = []
        self.path = path
        self._file: io.BufferedRandom | None = None
        self._offset = 0

    def open(self, offset: int) -> None:
        """Open the file and cut it at `offset` bytes; 0 starts it with a header."""
        if self.path is None:
            return
        self._file = self.path.open("r+b" if offset else "w+b")
        self._file.truncate(offset)
        if offset:
            self._file.seek(0)
            self.rows = _parse(self._file.read().decode())
        else:
            self._write(COLUMNS)

    def append(self, row: Row) -> None:
        self.rows.append(row)
        if self._file is not None:
            self._write(["" if math.isnan(v) else v for v in vars(row).values()])

    def forget_after(self, step: int) -> None:
        """Drop the rows of later steps, in the file too."""
        kept = [row for row in self.rows if row.step <= step]
        if self._file is not None:
            self._file.seek(0)
            self._file.truncate()
            self._write(COLUMNS)
        self.rows = []
        for row in kept:
            self.append(row)

    def flush(self) -> int:
        """Force what was written to the disk; length of the file in bytes."""
        if self._file is None:
            return 0
        with self._naming_the_file():
            os.fsync(self._file.fileno())
        return self._file.tell()

    def close(self) -> None:
        if self._file is not None:
            # Every row was flushed: what a close cannot write has been reported before.
            with contextlib.suppress(OSError):
                self._file.close()
            self._file = None

    def _write(self, values: object) -> None:
        assert self._file is not None
        text = io.StringIO(newline="")
        csv.writer(text, lineterminator="\n").writerow(values)  # type: ignore[arg-type]
        with self._naming_the_file():
            self._file.write(text.getvalue().encode())
            self._file.flush()

    @contextlib.contextmanager
    def _naming_the_file(self) -> Iterator[None]:
        """Errors of the operating system on an open file do not say which it is."""
        try:
            yield
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from error


def _parse(text: str) -> list[Row]:
    rows = csv.DictReader(io.StringIO(text))
    return [
        Row(**{k: int(v) if k == "step" else float(v or math.nan) for k, v in row.items()})  # type: ignore[arg-type]
        for row in rows
    ]
