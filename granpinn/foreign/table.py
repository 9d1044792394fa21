"""Rows of numbers in a table of text, by pandas."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from granpinn.foreign.program import Answer
from granpinn.regular import UnsafeFileError

LIBRARY = "pandas"
MISSING = ["-", "na", "none"]  # in addition to what pandas knows


def read(
    path: Path,
    answer: Answer,
    count: int,
    kept: list[int],
    skip: int,
    separator: str,
    decimal: str,
    encoding: str,
) -> list[Any]:
    """Some columns [n] of a table; NaN where a cell is empty. Other columns may hold text.

    Args:
        count: columns of the table.
        kept: indices of the columns to read.
        skip: lines before the rows.
        separator: of the cells; "" for blanks.
    """
    with path.open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # rows with more cells
        rows = pd.read_csv(
            stream,
            sep=separator or r"\s+",
            decimal=decimal,
            encoding=encoding,
            encoding_errors="replace",
            header=None,
            names=list(range(count)),
            index_col=False,
            skiprows=skip,
            skipinitialspace=True,
            na_values=MISSING,
        )
    return [answer.keep(_numbers(rows[k], k)) for k in kept]


def _numbers(column: Any, k: int) -> Any:
    if column.dtype.kind in "iuf":
        return np.asarray(column, np.float64)
    values = pd.to_numeric(column.astype(str), errors="coerce")
    if (text := column[values.isna() & column.notna()]).size:
        raise UnsafeFileError(
            f"it must have numbers in column {k + 1}, got {str(text.iloc[0])[:64]!r} in row "
            f"{text.index[0] + 1} of them: it is damaged, has two decimal signs, or has commas "
            "both between columns and in numbers; export it again"
        )
    return np.asarray(values, np.float64)
