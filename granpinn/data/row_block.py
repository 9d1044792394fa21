"""Rows of numbers that are added part by part."""

from __future__ import annotations

import torch


class Rows:
    """Rows in one block of memory: many small blocks would leave gaps between them.

    Args:
        most: rows; those that are never used take no memory.
    """

    def __init__(self, most: int, columns: int, dtype: torch.dtype) -> None:
        self._block, self._count = torch.empty(most, columns, dtype=dtype), 0

    def add(self, rows: torch.Tensor) -> None:
        self._block[self._count : self._count + len(rows)] = rows
        self._count += len(rows)

    @property
    def all(self) -> torch.Tensor:
        """The rows so far [count, columns]."""
        return self._block[: self._count]
