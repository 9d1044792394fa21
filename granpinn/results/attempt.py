"""Parts of a run that follow its results: each may fail alone.

The identified values are written first. What comes after them (effect of the assumptions, pressure
by the simulator, profile of I0, identification of simulated flows, simulation with the identified
law, figures, page) is optional for the values. So any error in such a part, a bug included, becomes
one sentence: a `NotDone` in results.json, in the terminal and on the page.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from concurrent.futures import CancelledError
from typing import Any, TypeVar

from granpinn.errors import memory_sentence
from granpinn.output import OutputError
from granpinn.results.records import NotDone
from granpinn.results.result import Result
from granpinn.terminal import visible

T = TypeVar("T")

# The parts by their names in `Result.not_done`.
FIELDS = "fields"
SCORES = "comparison with the reference"
SIMULATED_PRESSURE = "simulated pressure"
ASSUMPTIONS = "effect of the assumptions"
BASELINE = "momentum balance"
DETERMINED = "range of the law"
LAW_CURVE = "curve of the law"
COMPARISON = "comparison of laws"
PROFILE = "profile of I0"
RESIMULATION = "simulation with the identified law"
SIMULATOR_FIT = "fit of the simulator"
BOOTSTRAP = "identification of simulated flows"
REPORT = "report"
# Parts that are made without a flag; a run without them has exit code 0.
UNASKED = (ASSUMPTIONS, BASELINE, DETERMINED, LAW_CURVE, SIMULATED_PRESSURE, REPORT)

PENDING = "the run ended before it; --resume continues there"
LONGEST = 300  # characters of the message of an error


def attempt(what: str, work: Callable[[], T]) -> T | NotDone:
    """The result of `work`, or the sentence for its failure.

    Raises:
        OutputError: a file cannot be written. No later file can, so the run cannot go on.
        CancelledError: the run is stopping.
        KeyboardInterrupt: as `work`, Interrupted included.
    """
    try:
        return work()
    except (OutputError, CancelledError):
        raise
    except Exception as error:  # the one place where any error ends a part alone
        return NotDone(what, sentence(error))


def sentence(error: Exception) -> str:
    """One line about an error; errors of granpinn are sentences already."""
    memory = memory_sentence(error)
    text = " ".join((memory or str(error)).split())
    text = visible(text)[:LONGEST]
    if memory or type(error).__module__.partition(".")[0] == "granpinn":
        return text
    return f"{type(error).__name__}{f': {text}' if text else ''}"


def pending(result: Result, *parts: str) -> Result:
    """The result with parts that are still to be made: a run that is killed leaves this state."""
    for part in parts:
        result = lacking(result, NotDone(part, PENDING))
    return result


def awaited(result: Result, part: str) -> bool:
    """Whether a part is still to be made."""
    return NotDone(part, PENDING) in result.not_done


def lacking(result: Result, part: NotDone) -> Result:
    """The result without a part, with the reason."""
    result = having(result, part.what)
    return dataclasses.replace(result, not_done=(*result.not_done, part))


def having(result: Result, part: str, **values: Any) -> Result:
    """The result with a part that was made."""
    left = tuple(missing for missing in result.not_done if missing.what != part)
    return dataclasses.replace(result, not_done=left, **values)


def asked_for(result: Result) -> list[NotDone]:
    """The parts that the result lacks although the settings ask for them."""
    return [part for part in result.not_done if part.what not in UNASKED]
