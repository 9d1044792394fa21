"""history.csv: one row of loss terms and identified values every so many steps.

A row has the value of every column by its name: the step, which counts from 1; seconds of training;
the loss, and its unweighted terms in this batch; the parameters of the law; the learning rate. NaN
(an empty cell) is not part of this step.

A checkpoint holds the rows too. A resumed run writes the file anew with them, and appends the rows
of the later steps.
"""

from __future__ import annotations

import contextlib
import csv
import io
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from granpinn.arrays import Float64
from granpinn.errors import BadInput
from granpinn.output import naming, write_text
from granpinn.physics.laws import DEFAULT, FrictionLaw
from granpinn.physics.terms import NAMES, TERMS
from granpinn.regular import read_text

Row = dict[str, float]


def columns(law: FrictionLaw) -> tuple[str, ...]:
    """The columns of history.csv for a friction law."""
    return ("step", "wall_s", "loss", *NAMES, *law.names, "learning_rate")


def row_of(law: FrictionLaw, values: Iterable[float]) -> Row:
    """The row with these values in the order of `columns`."""
    step, *others = values
    return dict(zip(columns(law), (int(step), *others), strict=True))


def median(rows: Sequence[Row]) -> Row:
    """The medians, column by column, of one row of every member with the law of the first one."""
    alike = [row for row in rows if row.keys() == rows[0].keys()]
    return {name: float(np.median([row[name] for row in alike])) for name in rows[0]}


def described(row: Row) -> str:
    """The parameters, the loss and its terms in one line, without the unused terms."""
    _, _, _, *rest = row
    parts = [f"{name} {row[name]:.4f}" for name in rest[len(TERMS) : -1]]
    parts.append(f"loss {row['loss']:.3g}")
    terms = [(term.label, row[term.name]) for term in TERMS]
    return "  ".join(parts + [f"{label} {v:.1e}" for label, v in terms if math.isfinite(v)])


class HistoryFileError(BadInput):
    """history.csv is missing or not a table of numbers."""


class History:
    """The rows of a run, in memory and, where there is a run folder, in its history.csv."""

    def __init__(self, path: Path | None, law: FrictionLaw) -> None:
        self.rows: list[Row] = []
        self.law = law
        self.path = path
        self._file: TextIO | None = None

    def begin(self, rows: Iterable[Row] = ()) -> None:
        """Replace the file by one with these rows; OutputError if it cannot be written."""
        self.close()
        self.rows = list(rows)
        if self.path is not None:
            text = io.StringIO(newline="")
            _write([columns(self.law), *map(_cells, self.rows)], text)
            write_text(self.path, text.getvalue())
            with naming(self.path):
                self._file = self.path.open("a", newline="", encoding="utf-8")

    def append(self, row: Row) -> None:
        self.rows.append(row)
        if self._file is not None:
            with naming(self.path or ""):
                _write([_cells(row)], self._file)
                self._file.flush()

    @property
    def columns(self) -> dict[str, Float64]:
        """The columns of all rows by name."""
        return dict(zip(columns(self.law), self.table.T, strict=True))

    @property
    def table(self) -> Float64:
        """The numbers of all rows [n, columns]."""
        numbers = [[*row.values()] for row in self.rows]
        return np.array(numbers, np.float64).reshape(-1, len(columns(self.law)))

    def flush(self) -> None:
        """Force all rows to the disk."""
        if self._file is not None:
            with naming(self.path or ""):
                os.fsync(self._file.fileno())

    def close(self) -> None:
        if self._file is not None:
            # Every row has been flushed, so a failure was reported earlier.
            with contextlib.suppress(OSError):
                self._file.close()
            self._file = None


def _write(lines: Iterable[Iterable[object]], file: TextIO) -> None:
    csv.writer(file, lineterminator="\n").writerows(lines)


def _cells(row: Row) -> list[object]:
    return ["" if math.isnan(v) else v for v in row.values()]


def read_history(path: Path, law: FrictionLaw = DEFAULT) -> dict[str, Float64]:
    """The columns of history.csv; an empty cell is NaN, a last line without its end is left out."""
    names = columns(law)
    try:
        text = read_text(path)
        lines = [line.split(",") for line in text[: text.rfind("\n") + 1].splitlines()]
        if lines[:1] != [[*names]] or any(len(cells) != len(names) for cells in lines):
            raise ValueError(f"it should have the columns {', '.join(names)}")
        rows = [[float(cell or math.nan) for cell in cells] for cells in lines[1:]]
        table = np.array(rows, np.float64).reshape(-1, len(names))
        if not np.isfinite(table[:, 0]).all():
            raise ValueError("it should have a step in every line")
    except FileNotFoundError:
        raise HistoryFileError(f"{path.name} does not exist") from None
    except ValueError as error:
        raise HistoryFileError(f"{path.name} could not be read: {error}") from None
    return dict(zip(names, table.T, strict=True))
