"""What a check of a fit leaves in a result: its record, which says and shows all that it found.

A check is one file of granpinn/checks/. Its record is read, judged, printed and drawn through the
methods below, so that nothing else knows what it holds.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

if TYPE_CHECKING:
    from granpinn.results.result import Result

GOOD, CARE, BAD = "good", "care", "do not use"
ROOM = "granpinn.checks"


class Reason(NamedTuple):
    """A grade of `GOOD`, `CARE`, `BAD` that a sentence gives to a result."""

    grade: str
    sentence: str


class Table(NamedTuple):
    """Texts in columns; the first cell of a row is its name."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]

    def lines(self) -> list[str]:
        """The lines for a terminal: names to the left, other cells to the right."""
        every = [self.head, *self.rows]
        wide = [max(len(row[k]) for row in every) for k in range(len(self.head))]
        return [
            "  ".join([row[0].ljust(wide[0]), *map(str.rjust, row[1:], wide[1:])]).rstrip()
            for row in every
        ]


@dataclass(frozen=True)
class Record:
    """The base of the records of all checks, which are frozen dataclasses.

    Attributes:
        title: of the section on the page.
        notes: what the numbers mean, for the page.
    """

    title: ClassVar[str] = ""
    notes: ClassVar[str] = ""

    @property
    def words(self) -> str:
        """Sentences for the terminal and the page, one in a line, without a full stop."""
        raise NotImplementedError

    @property
    def table(self) -> Table | None:
        """Numbers below the words."""
        return None

    def reasons(self, result: Result) -> list[Reason]:
        """What the record says about the use of a result that holds it."""
        return []

    def figures(self) -> Mapping[str, tuple[str, Callable[[Any], Any]]]:
        """File name -> title and drawing function of a `figures.album.Source`."""
        return {}

    def __str__(self) -> str:
        """The lines for the terminal."""
        return "\n".join([self.words, *(self.table.lines() if self.table else ())])


def names() -> list[str]:
    """The names of all checks: those of their files."""
    spec = find_spec(ROOM)
    places = spec.submodule_search_locations if spec else None
    return sorted(module.name for module in pkgutil.iter_modules(places))


def record_type(name: str) -> type[Record]:
    """The record of a check; ValueError if there is no such check."""
    if name not in names():
        raise ValueError(f"checks.{name} is not known; expected {', '.join(names())}")
    found: type[Record] = import_module(f"{ROOM}.{name}").CHECK.record
    return found
