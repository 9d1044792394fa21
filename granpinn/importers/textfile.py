"""Text files of bounded size, read in blocks of whole lines, and their rows of numbers."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers.limits import open_file, require_room
from granpinn.importers.numerals import MAX_CHARACTERS, parse
from granpinn.importers.vectors import DataFileError

MAX_BYTES = 2**30
MAX_COLUMNS = 1000
MAX_LINE = 2**16  # characters
_BLOCK = 2**20


class TextFile:
    """The lines of a text file, without the byte order mark and with any line ends.

    Raises:
        DataFileError: the file cannot be opened, or its size is not between 1 byte and 1 GiB.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with open_file(path, MAX_BYTES) as stream:
            self.size = stream.seek(0, 2)

    def head(self, count: int) -> list[str]:
        """The first lines, at most `count`; at least one, which may be empty."""
        found: list[str] = []
        for block in self._blocks():
            found += block.split("\n", count)[:count]
            if len(found) >= count:
                break
        for number, line in enumerate(found[:count], 1):
            if len(line) > MAX_LINE:
                raise self._too_long(number)
        return found[:count]

    def lines(self, skip: int = 0) -> Iterator[str]:
        """The lines, without the first `skip` ones."""
        for _, lines in self.line_blocks(skip):
            yield from lines

    def line_blocks(self, skip: int = 0) -> Iterator[tuple[int, list[str]]]:
        """Number of the first line in the file, and lines, of one block after another."""
        number = 1
        for block in self._blocks():
            lines = block.split("\n")
            left = max(skip - number + 1, 0)
            yield number + left, lines[left:]
            number += len(lines)

    def _blocks(self) -> Iterator[str]:
        """Whole lines as text, about 1 MiB at a time, without the last line end."""
        left, rest, number, encoding = self.size, b"", 1, "utf-8-sig"
        with open_file(self.path, MAX_BYTES) as stream:
            while left > 0:
                piece = stream.read(min(left, _BLOCK))
                if not piece or (left == len(piece) and stream.read(1)):
                    raise DataFileError(
                        f"{self.path} changed while it was read: wait for the program that "
                        "writes it"
                    )
                left -= len(piece)
                if b"\0" in piece:
                    raise DataFileError(
                        f"{self.path} must be text, got binary data or UTF-16: name its "
                        "--format, or export it as UTF-8"
                    )
                content = rest + piece
                end = len(content)
                if left > 0:  # an "\r" at the very end may be half of a line end
                    end = content.rfind(b"\n") + 1 or content.rfind(b"\r", 0, end - 1) + 1
                if end == 0:
                    raise self._too_long(number)
                rest = content[end:]
                text = content[:end].decode(encoding, "replace")
                if "\r" in text:
                    text = text.replace("\r\n", "\n").replace("\r", "\n")
                encoding = "utf-8"
                text = text.removesuffix("\n")
                yield text
                number += text.count("\n") + 1

    def _too_long(self, number: int) -> DataFileError:
        return DataFileError(
            f"{self.path}, line {number}: expected at most {MAX_LINE} characters, got more: this "
            "is no table of vectors; export it again"
        )

    def numbers(self, skip: int = 0, *, decimal_comma: bool = False) -> Float64:
        """The rows of a table as [rows, columns]; blank lines are skipped.

        The columns are separated by tabs, blanks, commas or semicolons.

        Args:
            skip: lines before the table.
            decimal_comma: whether "," is the decimal point.
        """
        rows = Rows(self.path)
        for first, lines in self.line_blocks(skip):
            rows.add_lines(first, lines, decimal_comma)
        return rows.table()


class Rows:
    """Rows of numbers, which grow line by line."""

    def __init__(self, path: Path) -> None:
        self._path, self._columns, self._values = path, 0, array("d")

    def add_lines(self, first: int, lines: list[str], decimal_comma: bool) -> None:
        """Appends the rows of lines, the first of which is line `first` of the file.

        float() reads most lines. The exact parser reads the lines where float() fails, or where it
        would accept more than the exact parser.
        """
        start = len(self._values)
        for number, line in enumerate(lines, first):
            if decimal_comma:
                line = line.replace(",", ".").replace(";", " ")
            commas = "," in line or ";" in line
            cells = line.replace(";", ",").rstrip(",").split(",") if commas else line.split()
            try:
                row = [*map(float, cells)]
            except ValueError:
                self.add(number, _cells(line))
                continue
            long = len(line) > MAX_CHARACTERS and max(map(len, cells), default=0) > MAX_CHARACTERS
            if len(row) != self._columns or long or not line.isascii() or "_" in line:
                self.add(number, _cells(line))
            else:
                self._values.extend(row)
        if self._values and np.isinf(np.frombuffer(self._values)[start:]).any():
            for number, line in enumerate(lines, first):  # only the exact parser has a limit
                self._parsed(number, _cells(line))
        require_room(len(self._values), self._values.itemsize, self._path)

    def add(self, number: int, cells: list[str]) -> None:
        """Appends the cells of one line; nothing if there are none."""
        row = self._parsed(number, cells)
        if not self._values:
            self._columns = len(row)
        if len(row) > MAX_COLUMNS:
            raise DataFileError(
                f"{self._path}, line {number}: expected at most {MAX_COLUMNS} columns, got "
                f"{len(row)}: this is no table of vectors; export it again"
            )
        if row and len(row) != self._columns:
            raise DataFileError(
                f"{self._path}, line {number}: expected {self._columns} columns as above, got "
                f"{len(row)}: the file was cut off or mixes tables; export it again"
            )
        self._values.extend(row)

    def _parsed(self, number: int, cells: list[str]) -> list[float]:
        row = []
        for column, cell in enumerate(cells, 1):
            try:
                row.append(parse(cell))
            except ValueError:
                raise DataFileError(
                    f"{self._path}, line {number}: expected numbers, got {cell[:MAX_CHARACTERS]!r} "
                    f"in column {column}: this is not the format it was taken for, or the line is "
                    "damaged"
                ) from None
        return row

    def table(self) -> Float64:
        """All rows [rows, columns]."""
        if not self._values:
            raise DataFileError(f"{self._path} has no rows of numbers: export it again")
        return np.frombuffer(self._values).reshape(-1, self._columns)


def _cells(line: str) -> list[str]:
    """The cells of a line; a comma or semicolon separates, and so do blanks."""
    text = line.replace(";", ",").strip().rstrip(",").rstrip()
    parts = [part.split() or [""] for part in text.split(",")]
    return [cell for part in parts for cell in part] if text else []
