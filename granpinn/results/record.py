"""What a check of a flow or of a fit leaves: its record, which says and shows all that it found.

A check is one file of granpinn/inspection/ (of a flow, before a training) or granpinn/checks/ (of a
fit): its record, a function that makes it, and `CHECK`. The record is read, judged, printed and
drawn through the methods below, so that nothing else knows what it holds.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, ClassVar

from granpinn.errors import memory_sentence
from granpinn.output import OutputError
from granpinn.output.table import Table as Table  # checks take it from here
from granpinn.terminal import visible

if TYPE_CHECKING:
    from granpinn.config import Config

FLOW, FIT = "granpinn.inspection", "granpinn.checks"
PENDING = "the run ended before it; --resume continues there"
LONGEST = 300  # characters of the message of an error
NONE, QUICK, ALL = "none", "quick", "all"  # words of --checks
GOOD, CARE, BAD = "good", "care", "do not use"  # of a result
# Of a flow. Training refuses what is impossible: it contradicts a conservation law. Where a flow is
# improbable, a law from it is probably wrong. A size that is unusual may be right. Advice improves
# the measurement.
SLIPS = IMPOSSIBLE, IMPROBABLE, UNUSUAL = "impossible", "improbable", "unusual"
ADVICE = "advice"
GRADES = (GOOD, CARE, BAD, *SLIPS, ADVICE)


@dataclass(frozen=True)
class Reason:
    """A grade that a sentence gives to a flow or a result.

    Raises:
        ValueError: there is no such grade.
    """

    grade: str
    sentence: str

    def __post_init__(self) -> None:
        if self.grade not in GRADES:
            raise ValueError(f"grade must be one of {', '.join(GRADES)}, got {self.grade!r}")

    def __str__(self) -> str:
        return f"{self.grade}: {self.sentence}"


@dataclass(frozen=True)
class Record:
    """The base of the records of all checks, which are frozen dataclasses.

    Attributes:
        title: of the section on the page, or of the line of an inspection.
        notes: what the numbers mean, for the page.
    """

    title: ClassVar[str] = ""
    notes: ClassVar[str] = ""

    @property
    def words(self) -> str:
        """Sentences for the terminal and the page, one in a line, without a full stop."""
        return ""

    @property
    def table(self) -> Table | None:
        """Numbers below the words."""
        return None

    def reasons(self, of: Any) -> list[Reason]:
        """What the record says about the use of the result or inspection that holds it."""
        return []

    def figures(self) -> Mapping[str, tuple[str, Callable[[Any], Any]]]:
        """File name -> title and drawing function of an `Identification` or inspection."""
        return {}

    def __str__(self) -> str:
        """The lines for the terminal."""
        return "\n".join([self.words, *(self.table.lines() if self.table else ())])


@dataclass(frozen=True)
class Check:
    """A check of a flow or of a fit.

    Attributes:
        name: of its file, its key in JSON and its word for --checks.
        record: the class of its records.
        make: gives the record of a `fit.context.Context` or an `inspection.Inspection`; None where
            the check does not apply.
        seconds: that it takes after a training of one minute on two cores, roughly. Checks are made
            in this order. Those of a flow take 2 s together: theirs give the order of the lines
            only.
        flag: the setting or the word of the command that asks for it too.
        quick: whether the default makes it; of a flow: whether `convert` and `train` make it too.
        explains: whether a slip that it finds explains what later checks of this kind would find,
            which are then left out.
    """

    name: str
    record: type[Record]
    make: Callable[[Any], Record | None]
    seconds: float
    flag: str | None = None
    quick: bool = True
    explains: bool = False

    def wanted(self, config: Config) -> bool:
        """Whether the settings want this check of a fit."""
        words = config.checks.split(",")
        return self.asked(config) or ALL in words or (self.quick and QUICK in words)

    def asked(self, config: Config) -> bool:
        """Whether the settings name this check, or ask for it by its flag."""
        flag = self.flag is not None and bool(getattr(config, self.flag, False))
        return flag or self.name in config.checks.split(",")


def why_not_done(error: Exception, *fatal: type[Exception]) -> str:
    """Why a part that follows the values of a run was not done, in one line.

    The values are on the disk before it. So any error of it, a bug included, is a sentence.

    Raises:
        error: a file cannot be written, and so no later one; or it is of a class of `fatal`.
    """
    if isinstance(error, (OutputError, *fatal)):
        raise error
    memory = memory_sentence(error)
    text = visible(" ".join((memory or str(error)).split()))[:LONGEST]
    if memory or type(error).__module__.partition(".")[0] == "granpinn":
        return text
    return f"{type(error).__name__}{f': {text}' if text else ''}"


def names(room: str) -> list[str]:
    """The names of all checks of a package: those of its files."""
    spec = find_spec(room)
    places = spec.submodule_search_locations if spec else None
    return sorted(module.name for module in pkgutil.iter_modules(places))


@cache
def every(room: str) -> tuple[Check, ...]:
    """All checks of a package, in the order in which they are made."""
    found: list[Any] = [import_module(f"{room}.{name}").CHECK for name in names(room)]
    return tuple(sorted(found, key=lambda check: (check.seconds, check.name)))


def record_type(name: str) -> type[Record]:
    """The record of a check of a fit; ValueError if there is no such check."""
    if name not in names(FIT):
        raise ValueError(f"checks.{name} is not known; expected {', '.join(names(FIT))}")
    found: type[Record] = import_module(f"{FIT}.{name}").CHECK.record
    return found
