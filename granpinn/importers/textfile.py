"""Text files of bounded size, read in blocks of whole lines, and their rows of numbers."""

from __future__ import annotations

import codecs
import csv
from array import array
from collections.abc import Iterator, Sequence
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers.limits import open_file, require_room
from granpinn.importers.numerals import MAX_CHARACTERS, parse
from granpinn.importers.vectors import DataFileError

MAX_BYTES = 2**30
MAX_COLUMNS = 1000
MAX_LINE = 2**16  # characters
_BLOCK = 2**20
_ZEROS = 3  # UTF-16 without a mark has more zero bytes than one of so many
_COMMENTS = ("#", "%")
# What programs write where a number is missing.
_MISSING = ("", "na", "n/a", "none", "null", "-")


class TextFile:
    """The lines of a text file in UTF-8, UTF-16 or Latin-1, with any line ends.

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

    def _line_blocks(self, skip: int = 0) -> Iterator[tuple[int, list[str]]]:
        """Number of the first line in the file, and lines, of one block after another."""
        number = 1
        for block in self._blocks():
            lines = block.split("\n")
            left = max(skip - number + 1, 0)
            yield number + left, lines[left:]
            number += len(lines)

    def _blocks(self) -> Iterator[str]:
        """Whole lines as text, about 1 MiB at a time, without the last line end."""
        left, rest, number = self.size, "", 1
        with open_file(self.path, MAX_BYTES) as stream:
            decoder: Any = None
            while left > 0:
                piece = stream.read(min(left, _BLOCK))
                if not piece or (left == len(piece) and stream.read(1)):
                    raise DataFileError(
                        f"{self.path} changed while it was read: wait for the program that "
                        "writes it"
                    )
                left -= len(piece)
                if decoder is None:
                    decoder = codecs.getincrementaldecoder(encoding_of(piece))("replace")
                text = rest + decoder.decode(piece, left == 0)
                if "\0" in text:
                    raise DataFileError(
                        f"{self.path} must be text, got binary data: name its --format, or export "
                        "it as UTF-8"
                    )
                end = len(text)
                if left > 0:  # an "\r" at the very end may be half of a line end
                    end = text.rfind("\n") + 1 or text.rfind("\r", 0, end - 1) + 1
                if end == 0 and left > 0:
                    raise self._too_long(number)
                text, rest = text[:end], text[end:]
                if "\r" in text:
                    text = text.replace("\r\n", "\n").replace("\r", "\n")
                text = text.removesuffix("\n")
                yield text
                number += text.count("\n") + 1

    def _too_long(self, number: int) -> DataFileError:
        return DataFileError(
            f"{self.path}, line {number}: expected at most {MAX_LINE} characters, got more: this "
            "is no table of vectors; export it again"
        )

    def numbers(
        self,
        skip: int = 0,
        *,
        separator: str | None = None,
        count: int | None = None,
        kept: Sequence[int] | None = None,
    ) -> Float64:
        """The rows of a table as [rows, columns]; blank lines are skipped, empty cells are NaN.

        One separator holds for the whole file. A comma is the decimal sign where ";" or tabs
        separate.

        Args:
            skip: lines before the table.
            separator: ";", a tab, "," or "" for blanks; None: that of the first row.
            count: cells of every row; None: as many as the first row has.
            kept: indices of the columns that are read, None for all. Others may hold text.

        Raises:
            DataFileError: a row has more or fewer cells, or a cell is no number.
        """
        values, signs = array("d"), set[str]()
        for first, lines in self._line_blocks(skip):
            for number, line in enumerate(lines, first):
                if not line or line.isspace() or line.startswith(_COMMENTS):
                    continue
                if separator is None:
                    separator = separator_of(line)
                try:
                    cells = cells_of(line, separator)
                except csv.Error as error:
                    raise DataFileError(
                        f"{self.path}, line {number}: expected cells of a table, got another text "
                        f"({error}): export it again"
                    ) from None
                if count is None:
                    count = len(cells) - (not cells[-1].strip())
                if len(cells) == count + 1 and not cells[-1].strip():
                    del cells[-1]
                if len(cells) != count or count > MAX_COLUMNS:
                    raise _wrong_count(f"{self.path}, line {number}", len(cells), count)
                if kept is not None:
                    cells = [cells[i] for i in kept]
                if separator in (";", "\t") and ("," in line or "," in signs or not signs):
                    cells = _with_points(f"{self.path}, line {number}", cells, signs)
                # float() accepts more than the exact parser, and fails on empty cells.
                try:
                    row = [*map(float, cells)]
                    exact = inf not in row and -inf not in row and "_" not in line
                except ValueError:
                    exact = False
                long = len(line) > MAX_CHARACTERS and max(map(len, cells), default=0)
                if not exact or long > MAX_CHARACTERS or not line.isascii():
                    row = _parsed(f"{self.path}, line {number}", cells, kept)
                values.extend(row)
            require_room(len(values), values.itemsize, self.path)
        if not values:
            raise DataFileError(f"{self.path} has no rows of numbers: export it again")
        return np.frombuffer(values).reshape(-1, count or 1 if kept is None else len(kept))


def _wrong_count(where: str, found: int, count: int) -> DataFileError:
    """The refusal of a row of other than `count` cells, or of too many."""
    if count > MAX_COLUMNS:
        return DataFileError(
            f"{where}: expected at most {MAX_COLUMNS} columns, got {count}: this is no table of "
            "vectors; export it again"
        )
    cause = "it was cut off here, or this line is no row of the table"
    if found > count:
        cause = "it has a comma both between columns and in numbers, or mixes tables"
    return DataFileError(
        f"{where}: expected {count} cells as above, got {found}: {cause}; export it again"
    )


def _with_points(where: str, cells: list[str], signs: set[str]) -> list[str]:
    """The cells with a point as decimal sign; one file has one sign, which joins `signs`."""
    signs |= {sign for sign in ",." if any(sign in cell for cell in cells)}
    if len(signs) > 1:
        raise DataFileError(
            f"{where}: expected one decimal sign in all numbers, got a comma and a point: export "
            "the file with points"
        )
    return [cell.replace(",", ".") for cell in cells] if "," in signs else cells


def _parsed(where: str, cells: list[str], kept: Sequence[int] | None) -> list[float]:
    """The numbers of cells by the exact parser, NaN where one is missing."""
    row = []
    for k, cell in enumerate(cells):
        text = cell.strip()
        try:
            row.append(nan if text.lower() in _MISSING else parse(text))
        except ValueError:
            comma = {",", " "} & {*text} and "separate columns with ';' or tabs, or use points"
            raise DataFileError(
                f"{where}: expected numbers, got {cell[:MAX_CHARACTERS]!r} in column "
                f"{1 + (k if kept is None else kept[k])}: "
                + (comma or "this is not the format it was taken for, or the line is damaged")
            ) from None
    return row


def encoding_of(content: bytes) -> str:
    """UTF-16, UTF-8, or Latin-1 where it is neither, from the first bytes of a file."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even, odd = (content[k::2].count(0) for k in (0, 1))
    if even + odd > len(content) / _ZEROS and 0 in (even, odd):  # every second byte of ASCII
        return "utf-16-le" if odd else "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(content)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def is_number(cell: str) -> bool:
    """Whether a cell of a table holds a number, with a point or a comma."""
    try:
        parse(cell.strip().replace(",", "."))
    except ValueError:
        return False
    return True


def separator_of(line: str) -> str:
    """The separator of the cells of a line, "" for blanks."""
    return next((mark for mark in ";\t," if mark in line), "")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, which may stand in double quotes.

    Raises:
        csv.Error: the quotes do not fit together.
    """
    if '"' in line:
        return next(csv.reader([line], delimiter=separator or " ", strict=True), [])
    return line.split(separator) if separator else line.split()
