"""Checks of a fit: what else is computed, so that a user can trust its numbers.

A check is one file of this folder: a record (results/record.py), a function that makes it from a
fit, and `CHECK`. To add a check, add its file; to remove it, delete the file. One loop makes those
that the settings want, the quick ones first.
"""

from __future__ import annotations

from granpinn.config import Config, ConfigError
from granpinn.results.record import ALL, FIT, NONE, QUICK, Check, every, names


def wanted(config: Config) -> list[Check]:
    """The checks that the settings want, in their order.

    Raises:
        ConfigError: --checks has an unknown word.
    """
    known = (NONE, QUICK, ALL, *names(FIT))
    for word in config.checks.split(","):
        if word not in known:
            raise ConfigError(
                f"--checks must be words of {', '.join(known)}, with commas between them, got "
                f"{word!r}"
            )
    return [check for check in every(FIT) if check.wanted(config)]
