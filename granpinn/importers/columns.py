"""Columns of a table by their names, each with its own unit in brackets: `x [mm]`, `Time (ms)`.

All tables that a user writes are read here: tracks, --times, --surface and --walls. Formats of
instruments bring names and units from headers of their own.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from granpinn.arrays import Float64
from granpinn.importers import units
from granpinn.importers.textfile import TextFile, cells_of, is_number, separator_of
from granpinn.importers.vectors import LARGEST, DataFileError, largest

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
_WITH_DIMENSION = {*(name for group in GROUPS.values() for name in group), "p", "tau"}
_COLUMN = re.compile(r"([^\[(]++)(?:[\[(]([^\])]*+)[\])])?")
HEADER_LINES = 100
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
        try:
            cells = cells_of(text, separator)
        except csv.Error:
            return []
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
    """Columns of a table, number of lines before its rows, and its separator."""

    named: list[Column]
    skip: int
    separator: str


def layout_of(
    lines: Sequence[str], roles: Mapping[str, Iterable[str]], required: Iterable[str]
) -> TextLayout:
    """The layout of a table of any program, from its first lines.

    The names are in the first line above the numbers that has the required columns, else in the
    last line there. Other lines may follow up to one of units in brackets.
    """
    start = next((k for k, line in enumerate(lines) if _is_row(line)), len(lines))
    above = [k for k in range(start) if lines[k].strip()] or [0]
    row = lines[start] if start < len(lines) else lines[above[-1]]
    separator = separator_of(row)
    wanted = [set(roles[role]) for role in required]
    headers = {k: header(lines[k], separator) for k in above}
    complete = [k for k in above if all(w & {c.name for c in headers[k]} for w in wanted)]
    place = complete[0] if complete else above[-1 if start < len(lines) else 0]
    named, skip = headers[place], place + 1
    for k in range(place + 1, start):
        cells = [cell.strip() for cell in _cells(lines[k], separator)]
        if any(cells) and all(not c or (c[0] in "[(" and c[-1] in ")]") for c in cells):
            units, skip = [cell[1:-1].strip() for cell in cells], k + 1
            named = [Column(c.name, c.unit or u) for c, u in zip(named, units, strict=False)]
    if separator != "," and len(_cells(row.rstrip(separator), separator)) == len(named) + 1:
        named = [Column(""), *named]  # a column of row names has no name
    return TextLayout(named, skip, separator)


def _cells(line: str, separator: str) -> list[str]:
    try:
        return cells_of(line, separator)
    except csv.Error:
        return []


def _is_row(line: str) -> bool:
    """Whether at least half of the filled cells of a line are numbers, and it is no comment."""
    if line.startswith(("#", "%")):
        return False
    cells = [cell for cell in _cells(line, separator_of(line)) if cell.strip()]
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
    text: TextFile,
    roles: Mapping[str, Iterable[str]],
    named: Sequence[Column],
    required: Iterable[str],
    skip: int = 1,
    separator: str | None = None,
) -> TextTable:
    """The columns of a text file that have a role; others may hold text.

    Args:
        roles: the names that a column of each role may have.
        named: all columns, from the header.
        required: roles that may not be missing.
        skip: lines before the numbers.
        separator: of the header, if it is that of the rows; else None.

    Raises:
        DataFileError: as `chosen`, or the rows do not fit the header.
    """
    places, stated = chosen(text.path, named, roles, required)
    kept = [*places.values()]
    rows = text.numbers(skip, separator=separator, count=len(named), kept=kept)
    columns = {role: rows[:, k] for k, role in enumerate(places)}
    return TextTable(columns, stated, tuple(named))


def read_headed(
    path: Path, required: Iterable[str], roles: Mapping[str, Iterable[str]] = NAMES
) -> TextTable:
    """The columns of a file that names them above its rows; arguments as in `read_table`."""
    text = TextFile(path)
    named, skip, separator = layout_of(text.head(HEADER_LINES), roles, required)
    return read_table(text, roles, named, required, skip, separator)


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
