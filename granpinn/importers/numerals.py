"""The number parser of all text: files, names of files, and options.

A number has at most 64 ASCII characters. Python alone would also accept "1_000", digits of other
scripts, and integers of any length, whose conversion takes quadratic time.
"""

from __future__ import annotations

import math

from granpinn.importers.vectors import DataFileError

MAX_CHARACTERS = 64
_MAX_DIGITS = 18  # of an integer, which then fits in 64 bits


def parse(text: str) -> float:
    """The number of a cell of a table; NaN and infinity only where the text says so.

    Raises:
        ValueError: the text is no number, is longer than 64 characters, or is too large for
            float64.
    """
    if len(text) > MAX_CHARACTERS or not text.isascii() or "_" in text:
        raise ValueError("no plain number")
    value = float(text)
    if math.isinf(value) and any(character.isdigit() for character in text):
        raise ValueError("too large")
    return value


def number(text: str, what: str) -> float:
    """A finite number; `what` names its place for the message.

    Raises:
        DataFileError: the text is no finite number.
    """
    try:
        value = parse(text.strip())
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataFileError(f"{what} must be a finite number, got {text[:MAX_CHARACTERS]!r}")
    return value


def whole(text: str, what: str) -> int:
    """An integer of at most 18 digits; `what` names its place for the message.

    Raises:
        DataFileError: the text is no such integer.
    """
    stripped = text.strip()
    digits = stripped[1:] if stripped[:1] in ("+", "-") else stripped
    if not (digits.isascii() and digits.isdigit() and len(digits) <= _MAX_DIGITS):
        raise DataFileError(
            f"{what} must be an integer of at most {_MAX_DIGITS} digits, got "
            f"{text[:MAX_CHARACTERS]!r}"
        )
    return int(stripped)
