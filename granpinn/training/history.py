"""history.csv: one row of loss terms and identified values every so many steps.

New rows are appended. A checkpoint holds the length of the file, and the SHA-256 of so many bytes.
A resumed run refuses other content and cuts the file there. The rows of later steps are then
written again.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from granpinn.arrays import Float64
from granpinn.errors import BadInput
from granpinn.output import OutputError, naming, objection_to_file
from granpinn.physics.laws import DEFAULT, FrictionLaw
from granpinn.physics.terms import NAMES
from granpinn.regular import read_text


def columns(law: FrictionLaw) -> tuple[str, ...]:
    """The columns of history.csv for a friction law."""
    return ("step", "wall_s", "loss", *NAMES, *law.names, "learning_rate")


@dataclass(frozen=True)
class Row:
    """Values of one step, in the order of `columns`; NaN (an empty cell): not part of this step.

    Attributes:
        step: counts from 1.
        wall_s: seconds of training up to this step.
        terms: unweighted loss terms of this batch, one for each of `NAMES`.
        parameters: theta, one for each of `law.names`.
    """

    law: FrictionLaw = field(repr=False)
    step: int
    wall_s: float
    loss: float
    terms: tuple[float, ...]
    parameters: tuple[float, ...]
    learning_rate: float

    @classmethod
    def of(cls, law: FrictionLaw, values: Iterable[float]) -> Row:
        """The row with these values in the order of `columns`."""
        step, wall_s, loss, *rest, rate = values
        terms, parameters = tuple(rest[: len(NAMES)]), tuple(rest[len(NAMES) :])
        return cls(law, int(step), wall_s, loss, terms, parameters, rate)

    def values(self) -> dict[str, float]:
        """The value of every column by its name."""
        rest = (*self.terms, *self.parameters, self.learning_rate)
        return dict(zip(columns(self.law), (self.step, self.wall_s, self.loss, *rest), strict=True))


def median(rows: Sequence[Row]) -> Row:
    """The medians, column by column, of one row of every member with the law of the first one."""
    if len(rows) == 1:
        return rows[0]
    alike = [row for row in rows if row.law is rows[0].law]
    table = zip(*(row.values().values() for row in alike), strict=True)
    return Row.of(rows[0].law, (float(np.median(column)) for column in table))


class HistoryFileError(BadInput):
    """history.csv is missing or not a table of numbers."""


class History:
    """The rows of a run, in memory and, where there is a run folder, in its history.csv."""

    def __init__(self, path: Path | None, law: FrictionLaw) -> None:
        self.rows: list[Row] = []
        self.law = law
        self.path = path
        self._file: io.BufferedRandom | None = None
        self._sha256 = hashlib.sha256()  # of the content of the file

    def open(self, offset: int = 0, sha256: str = "") -> None:
        """Open the file and cut it at `offset` bytes; 0 starts it with a header.

        Args:
            sha256: of the bytes before `offset`.

        ValueError: the file is shorter, was changed, or holds anything but rows.
        """
        if self.path is None:
            return
        if offset and self.path.stat().st_size < offset:
            raise ValueError(f"it should have at least {offset} bytes")
        if objection := objection_to_file(self.path):
            raise OutputError(objection)
        with naming(self.path):
            self._file = self.path.open("r+b" if offset else "w+b")
            content = self._file.read(offset)
        self._sha256 = hashlib.sha256(content)
        if offset == 0:
            self._write(columns(self.law))
            return
        if self._sha256.hexdigest() != sha256:
            raise ValueError(f"its first {offset} bytes were changed")
        self.rows = [Row.of(self.law, row) for row in _rows(content.decode(), self.law)]
        with naming(self.path):
            self._file.truncate(offset)
            self._file.seek(offset)

    def append(self, row: Row) -> None:
        self.rows.append(row)
        if self._file is not None:
            self._write(["" if math.isnan(v) else v for v in row.values().values()])

    def forget_after(self, step: int) -> None:
        """Drop the rows of later steps, in the file too."""
        kept = [row for row in self.rows if row.step <= step]
        if self._file is not None:
            self._file.seek(0)
            self._file.truncate()
            self._sha256 = hashlib.sha256()
            self._write(columns(self.law))
        self.rows = []
        for row in kept:
            self.append(row)

    def flush(self) -> tuple[int, str]:
        """Force all rows to the disk; length of the file in bytes, and its SHA-256."""
        if self._file is None:
            return 0, self._sha256.hexdigest()
        with naming(self.path or ""):
            os.fsync(self._file.fileno())
        return self._file.tell(), self._sha256.hexdigest()

    def close(self) -> None:
        if self._file is not None:
            # Every row has been flushed, so a failure was reported earlier.
            with contextlib.suppress(OSError):
                self._file.close()
            self._file = None

    def _write(self, values: object) -> None:
        assert self._file is not None
        text = io.StringIO(newline="")
        csv.writer(text, lineterminator="\n").writerow(values)  # type: ignore[arg-type]
        content = text.getvalue().encode()
        with naming(self.path or ""):
            self._file.write(content)
            self._file.flush()
        self._sha256.update(content)


def _rows(text: str, law: FrictionLaw) -> list[list[float]]:
    """The numbers of a history.csv, NaN for an empty cell; ValueError: it holds something else."""
    names = columns(law)
    try:
        header, *lines = [*csv.reader(io.StringIO(text))] or [[]]
    except csv.Error as error:
        raise ValueError(str(error)) from None
    if tuple(header) != names or any(len(cells) != len(names) for cells in lines):
        raise ValueError(f"it should have the columns {', '.join(names)}")
    rows = [[float(cell or math.nan) for cell in cells] for cells in lines]
    if not all(math.isfinite(row[0]) for row in rows):
        raise ValueError("it should have a step in every line")
    return rows


def read_history(path: Path, law: FrictionLaw = DEFAULT) -> dict[str, Float64]:
    """The columns of history.csv; an empty cell is NaN, a last line without its end is left out."""
    try:
        text = read_text(path)
        table = np.array(_rows(text[: text.rfind("\n") + 1], law), np.float64)
    except FileNotFoundError:
        raise HistoryFileError(f"{path.name} does not exist") from None
    except ValueError as error:
        raise HistoryFileError(f"{path.name} could not be read: {error}") from None
    names = columns(law)
    return dict(zip(names, table.reshape(-1, len(names)).T, strict=True))
