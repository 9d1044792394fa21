"""Tables of text: columns by their names, each with its own unit in brackets: `x [mm]`, `t_ms`.

Every text file is read here. Programs with headers of another kind bring the names and units of
their columns (grids.py). pandas reads the numbers, in the process of granpinn.foreign.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.data.flow import LARGEST
from granpinn.importers import units
from granpinn.importers.limits import read_file
from granpinn.importers.vectors import DataFileError, largest
from granpinn.regular import UnsafeFileError, first_bytes

# Spellings of the columns, in lower case.
NAMES = {
    "x": ("x", "x_position", "pos_x", "position_x", "x_pos"),
    "y": ("y", "y_position", "pos_y", "position_y", "y_pos"),
    "frame": ("frame", "frame_number", "frame_id"),
    "t": ("t", "time", "position_t"),
    "particle": ("particle", "id", "track", "track_id", "trajectory", "particle_id"),
    "u": ("u", "vx", "v_x", "u_x", "ux"),
    "v": ("v", "vy", "v_y", "u_y", "uy"),
    "sigma_u": ("sigma_u", "sigma_vx"),
    "sigma_v": ("sigma_v", "sigma_vy"),
    "ep": ("ep",),
}
# Columns of one dimension, which have one unit.
GROUPS = {
    "length_unit": ("x", "y", "ep"),
    "time_unit": ("t",),
    "velocity_unit": ("u", "v", "sigma_u", "sigma_v"),
}
_WITH_DIMENSION = {*(name for group in GROUPS.values() for name in group), "p"}
MAX_TEXT = 2**30  # bytes of a file
MAX_COLUMNS = 1000
HEAD = 2**16  # bytes that hold the lines above the numbers
_ZEROS = 3  # UTF-16 without a mark has more zero bytes than one of so many
_COLUMN = re.compile(r"([^\[(]++)(?:[\[(]([^\])]*+)[\])])?")
_NO_UNITS = ("prediction",)  # TracTrac's Vx(prediction)
_SUFFIXES = ("px", "pixel", "m", "cm", "mm", "um", "µm", "s", "ms", "us", "m/s", "mm/s", "px/frame")
_COMMENT = "\ufeff#% "
_NO_UNIT = ("", "1", "-", "#", "frame", "frames", "dimensionless")


class Column(NamedTuple):
    """Name of a column in lower case, and its unit, "" if it states none."""

    name: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class TextTable:
    """Chosen columns [n] by what they are, such as "u", their units, and all columns."""

    columns: dict[str, Float64]
    units: dict[str, str]
    named: tuple[Column, ...] = ()


def head_of(path: Path) -> bytes:
    """The first bytes of a file, which may be of any kind.

    Raises:
        DataFileError: it is no regular file.
    """
    try:
        return first_bytes(path, HEAD)
    except UnsafeFileError as error:
        raise DataFileError(f"{path}: {error}") from None


def encoding_of(content: bytes) -> str:
    """UTF-16, UTF-8, or Latin-1 where it is neither, from the first bytes of a file."""
    for mark, name in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        if content.startswith(mark):
            return name
    even, odd = (content[k::2].count(0) for k in (0, 1))
    if even + odd > len(content) / _ZEROS and 0 in (even, odd):  # every second byte of ASCII
        return "utf-16-le" if odd else "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(content)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def lines_of(head: bytes) -> list[str]:
    """The lines at the start of a file, at least one, which may be empty."""
    text = head.decode(encoding_of(head), "replace").removeprefix("\ufeff")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines[:-1] if len(head) == HEAD and len(lines) > 1 else lines


def text_lines(path: Path) -> list[str]:
    """The first lines of a file of text.

    Raises:
        DataFileError: it is binary, or begins with a line without an end.
    """
    lines = lines_of(head := head_of(path))
    if any("\0" in line for line in lines):
        raise DataFileError(
            f"{path} must be text, got binary data: name its --format, or export it as UTF-8"
        )
    if len(head) == HEAD and len(lines) == 1:
        raise DataFileError(f"{path} must have lines of at most {HEAD} bytes: export it again")
    return lines


def is_number(cell: str) -> bool:
    """Whether a cell of a table holds a number, with a point or a comma."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def separator_of(line: str) -> str:
    """The separator of the cells of a line, "" for blanks."""
    return next((mark for mark in ";\t," if mark in line), "")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, which may stand in double quotes; none if these do not fit together."""
    if '"' not in line:
        return line.split(separator) if separator else line.split()
    try:
        return next(csv.reader([line], delimiter=separator or " ", strict=True), [])
    except csv.Error:
        return []


def header(line: str, separator: str | None = None) -> list[Column]:
    """The columns that a line names; none if its quotes do not fit together.

    Args:
        separator: of the rows below; None: that of the line.
    """
    text = line.strip(" \r\n").lstrip(_COMMENT)
    if not separator or separator not in text:
        separator = separator_of(text)
    closing = "]" if "]" in text else ")"
    cells = text.split()
    if f" {'[' if closing == ']' else '('}" in text:  # names and units between blanks
        *stated, rest = text.split(closing)
        cells = [*(cell + closing for cell in stated), *rest.split()]
    if separator:
        cells = cells_of(text, separator)
    if cells and not cells[-1].strip():
        del cells[-1]
    return [column(cell) for cell in cells]


def column(text: str) -> Column:
    """The name and unit in the head of a column: `x [mm]`, `Time (ms)`, `x_mm`."""
    text = text.strip()
    match = _COLUMN.fullmatch(text)
    if match is None or match[2] in _NO_UNITS:
        return Column(text.lower())
    name, unit = match[1].strip().lower(), (match[2] or "").strip()
    base, _, suffix = name.rpartition("_")
    if base and not unit and suffix in _SUFFIXES:
        return Column(base, suffix)
    return Column(name, unit)


class TextLayout(NamedTuple):
    """Columns of a table, and the number of lines before its rows."""

    named: list[Column]
    skip: int


def layout_of(
    lines: Sequence[str], roles: Mapping[str, Iterable[str]], required: Iterable[str]
) -> TextLayout:
    """The layout of a table of any program, from its first lines.

    The names are in the first line above the numbers that has the required columns, else in the
    last line there. Other lines may follow up to one of units in brackets.
    """
    start = next((k for k, line in enumerate(lines) if _is_row(line)), len(lines))
    above = [k for k in range(start) if lines[k].strip()] or [0]
    separator = separator_of(lines[start] if start < len(lines) else lines[above[-1]])
    wanted = [set(roles[role]) for role in required]
    headers = {k: header(lines[k], separator) for k in above}
    complete = [k for k in above if all(w & {c.name for c in headers[k]} for w in wanted)]
    place = complete[0] if complete else above[-1 if start < len(lines) else 0]
    named, skip = headers[place], place + 1
    for k in range(place + 1, start):
        cells = [cell.strip() for cell in cells_of(lines[k], separator)]
        if any(cells) and all(not c or (c[0] in "[(" and c[-1] in ")]") for c in cells):
            units, skip = [cell[1:-1].strip() for cell in cells], k + 1
            named = [Column(c.name, c.unit or u) for c, u in zip(named, units, strict=False)]
    if separator == "," and len(named) > 1 and "," not in lines[place]:
        named = []  # commas are decimal signs there, and blanks separate
    return TextLayout(named, skip)


def roles_in(
    lines: Sequence[str], roles: Mapping[str, Iterable[str]], required: Iterable[str]
) -> set[str]:
    """The roles that the columns of a table have; arguments as in `layout_of`."""
    names = {column.name for column in layout_of(lines, roles, required).named}
    return {role for role, spellings in roles.items() if names.intersection(spellings)}


def _is_row(line: str) -> bool:
    """Whether at least half of the filled cells of a line are numbers, and it is no comment."""
    if line.startswith(("#", "%")):
        return False
    cells = [cell for cell in cells_of(line, separator_of(line)) if cell.strip()]
    return bool(cells) and 2 * sum(map(is_number, cells)) >= len(cells)


def chosen(
    path: Path | str,
    named: Sequence[Column],
    roles: Mapping[str, Iterable[str]],
    required: Iterable[str] = (),
) -> tuple[dict[str, int], dict[str, str]]:
    """Index and unit of the columns by their roles.

    Args:
        roles: the names that a column of each role may have.
        required: roles that may not be missing.

    Raises:
        DataFileError: a column is missing, two columns have one role, or a number without a unit
            states one.
    """
    places: dict[str, int] = {}
    stated: dict[str, str] = {}
    for role, spellings in roles.items():
        indices = [i for i, column in enumerate(named) if column.name in spellings]
        if len(indices) > 1:  # an id may number the rows where a track has a name of its own
            indices = [i for i in indices if named[i].name != "id"]
        if len(indices) > 1:
            raise DataFileError(
                f"{path} must have one column for {role}, got "
                f"{', '.join(named[i].name for i in indices)}: leave out or rename the others"
            )
        for i in indices:
            places[role], unit = i, named[i].unit
            if role in _WITH_DIMENSION and unit:
                stated[role] = unit
            elif unit.lower() not in _NO_UNIT:
                raise DataFileError(
                    f"{path} must have plain numbers without a unit as {role}, got the unit "
                    f"{unit}: convert the column"
                )
    require(path, named, [next(iter(roles[role])) for role in required if role not in places])
    return places, stated


def require(path: Path | str, named: Sequence[Column], missing: Sequence[str]) -> None:
    """Refuses a table where columns are missing."""
    if missing:
        names = ", ".join(column.name for column in named[:12])
        raise DataFileError(
            f"{path} must have the columns {', '.join(missing)}, got {names or 'no names'}: name "
            "the columns so, or export the file again"
        )


def read_table(
    path: Path,
    roles: Mapping[str, Iterable[str]],
    named: Sequence[Column],
    required: Iterable[str],
    skip: int = 1,
) -> TextTable:
    """The columns of a text file that have a role; others may hold text.

    A comma is the decimal sign where ";" or tabs separate the cells of a row with one.

    Args:
        roles: the names that a column of each role may have.
        named: all columns, from the header.
        required: roles that may not be missing.
        skip: lines before the numbers.

    Raises:
        DataFileError: as `chosen`, or the rows do not fit the header.
    """
    places, stated = chosen(path, named, roles, required)
    kept = [*places.values()]
    lines = [line for line in text_lines(path)[skip:] if line.strip()]
    if not lines:
        raise DataFileError(f"{path} has no rows of numbers: export it again")
    separator = separator_of(lines[0])
    cells = cells_of(lines[0], separator)
    count = len(cells) - (len(cells) == len(named) + 1 and not cells[-1].strip())
    if count != len(named) or count > MAX_COLUMNS:
        cause = "a row with a comma both between columns and in numbers" * (separator == ",")
        raise DataFileError(
            f"{path} must have {len(named)} cells in every row as in its header, at most "
            f"{MAX_COLUMNS}, got {count}: it may have {cause or 'lost columns'}; export it again"
        )
    encoding = encoding_of(head_of(path))
    if len(cells_of(_last_line(path, encoding), separator)) < count:
        raise DataFileError(
            f"{path} must have {count} cells in its last row as in the others, got fewer: it was "
            "cut off; export it again"
        )
    values = read_file(
        "table",
        path,
        MAX_TEXT,
        count=count,
        kept=kept,
        skip=skip,
        separator=separator,
        decimal="," if _has_commas(lines, separator, kept) else ".",
        encoding=encoding,
    )
    return TextTable(dict(zip(places, values, strict=True)), stated, tuple(named))


def _has_commas(lines: Sequence[str], separator: str, kept: Iterable[int]) -> bool:
    """Whether a comma is the decimal sign: in some cells of columns that are read."""
    if separator not in (";", "\t"):
        return False
    rows = [cells_of(line, separator) for line in lines]
    return any("," in row[k] for row in rows for k in kept if k < len(row))


def _last_line(path: Path, encoding: str) -> str:
    """The last line of a file that is not blank, or the end of it."""
    with path.open("rb") as stream:
        stream.seek(-2 * min(stream.seek(0, 2) // 2, HEAD // 2), 2)  # UTF-16 has pairs of bytes
        end = stream.read(HEAD).decode(encoding.removesuffix("-sig"), "replace")
    return end.rstrip("\0\r\n ").replace("\r", "\n").rpartition("\n")[2]


def read_headed(
    path: Path, required: Iterable[str], roles: Mapping[str, Iterable[str]] = NAMES
) -> TextTable:
    """The columns of a file that names them above its rows; arguments as in `read_table`."""
    named, skip = layout_of(text_lines(path), roles, required)
    return read_table(path, roles, named, required, skip)


def require_finite(path: Path | str, columns: Mapping[str, Float64], *, nan: bool = False) -> None:
    """Refuses infinite and huge numbers, and NaN unless it may be there."""
    for name, values in columns.items():
        wrong = np.isinf(values) if nan else ~np.isfinite(values)
        if wrong.any() or largest(values) > LARGEST:
            first = values[wrong | (np.abs(values) > LARGEST)][0]
            raise DataFileError(
                f"{path} must have a finite {name} of at most {LARGEST:g} in every row, got "
                f"{first:g}: leave this row out"
            )


def units_of(path: Path | str, stated: Mapping[str, str]) -> dict[str, Any]:
    """length_unit, time_unit and velocity_unit of columns, None if unknown.

    A column that states no unit has that of the others of its kind.

    Args:
        stated: units by the names of columns.

    Raises:
        DataFileError: two columns of one kind are in different units.
    """
    found: dict[str, Any] = {}
    for kind, names in GROUPS.items():
        known = [(name, stated[name]) for name in names if stated.get(name)]
        found[kind] = base = known[0][1] if known else None
        for name, unit in known:
            if unit != base and units.ratio(unit, str(base), f"{path}: {name}") != 1:
                raise DataFileError(
                    f"{path} must have one {kind.replace('_', ' ')} in all columns, got "
                    f"{known[0][0]} in {base} and {name} in {unit}: export both in one unit"
                )
    return found
