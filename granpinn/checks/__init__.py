"""Checks of a fit: what else is computed, so that a user can trust its numbers.

A check is one file of this folder: a record (results/record.py), a function that makes it from a
fit, and `CHECK`. To add a check, add its file; to remove it, delete the file. One loop makes those
that the settings want, the quick ones first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from granpinn.config import Config, ConfigError
from granpinn.results.record import ROOM, Record, names

if TYPE_CHECKING:
    from granpinn.fit.context import Context

NONE, QUICK, ALL = "none", "quick", "all"


@dataclass(frozen=True)
class Check:
    """A check of a fit.

    Attributes:
        name: of its file, its key in results.json and its word for --checks.
        record: the class of its records.
        make: gives the record of a fit; None where the check does not apply.
        seconds: that it takes after a training of one minute on two cores, roughly. Checks are made
            in this order.
        flag: the setting that asks for it too.
        quick: whether the default makes it.
        trains: whether it trains more networks, in which every process takes part.
        refuse: raises ConfigError for settings under which it cannot be asked for.
    """

    name: str
    record: type[Record]
    make: Callable[[Context], Record | None]
    seconds: float
    flag: str | None = None
    quick: bool = True
    trains: bool = False
    refuse: Callable[[Config], None] | None = None

    def asked(self, config: Config) -> bool:
        """Whether the settings name this check, or ask for it by its flag."""
        flag = self.flag is not None and bool(getattr(config, self.flag))
        return flag or self.name in config.checks.split(",")

    def wanted(self, config: Config) -> bool:
        """Whether the settings want this check."""
        words = config.checks.split(",")
        return self.asked(config) or ALL in words or (self.quick and QUICK in words)


@cache
def every() -> tuple[Check, ...]:
    """All checks, in the order in which they are made."""
    found: list[Any] = [import_module(f"{ROOM}.{name}").CHECK for name in names()]
    return tuple(sorted(found, key=lambda check: (check.seconds, check.name)))


def wanted(config: Config) -> list[Check]:
    """The checks that the settings want, in their order.

    Raises:
        ConfigError: --checks has an unknown word, or the settings ask for a check that they cannot
            have.
    """
    known = (NONE, QUICK, ALL, *names())
    for word in config.checks.split(","):
        if word not in known:
            raise ConfigError(
                f"--checks must be words of {', '.join(known)}, with commas between them, got "
                f"{word!r}"
            )
    checks = [check for check in every() if check.wanted(config)]
    for check in checks:
        if check.refuse is not None and check.asked(config):
            check.refuse(config)
    return checks


def make(context: Context, checks: Sequence[Check]) -> None:
    """Make checks one after another; what each finds is written and shown before the next.

    A check that fails leaves its reason in the result, and the others go on.
    """
    for check in checks:
        context.attempt(check.name, partial(check.make, context))
        context.keep(context.result)
