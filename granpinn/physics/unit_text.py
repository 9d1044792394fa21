"""The text of a unit, as files and options may give it."""

from __future__ import annotations

MAX_CHARACTERS = 60
# Figures would take a dollar sign or a backslash for the start of a formula.
_FORMULA = frozenset("$\\")


def is_short(text: str) -> bool:
    """Whether a text can name a unit: at most 60 printable characters, and no formula."""
    return len(text) <= MAX_CHARACTERS and text.isprintable() and not _FORMULA & set(text)
