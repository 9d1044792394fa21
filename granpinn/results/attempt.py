"""Parts of a run that follow its values: each may fail alone.

The identified values are written first. What comes after them (fields, checks, figures, page) is
optional for the values. So any error in such a part, a bug included, becomes one sentence.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import TypeVar

from granpinn.errors import memory_sentence
from granpinn.output import OutputError
from granpinn.terminal import visible

T = TypeVar("T")

PENDING = "the run ended before it; --resume continues there"
LONGEST = 300  # characters of the message of an error


@dataclass(frozen=True)
class NotDone:
    """Why a part failed, in a sentence."""

    why: str


def attempt(work: Callable[[], T], *fatal: type[Exception]) -> T | NotDone:
    """The result of `work`, or the sentence for its failure.

    Raises:
        OutputError: a file cannot be written. No later file can, so the run cannot go on.
        CancelledError: the run is stopping.
        KeyboardInterrupt: as `work`, Interrupted included.
        Exception: of a class of `fatal`, as `work`.
    """
    try:
        return work()
    except Exception as error:  # the one place where any error ends a part alone
        if isinstance(error, (OutputError, CancelledError, *fatal)):
            raise
        return NotDone(sentence(error))


def sentence(error: Exception) -> str:
    """One line about an error; errors of granpinn are sentences already."""
    memory = memory_sentence(error)
    text = " ".join((memory or str(error)).split())
    text = visible(text)[:LONGEST]
    if memory or type(error).__module__.partition(".")[0] == "granpinn":
        return text
    return f"{type(error).__name__}{f': {text}' if text else ''}"
