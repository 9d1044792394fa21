"""The errors that end a command, by what the user can do about them.

Every error class of granpinn derives from one of these, so a new error needs no further entry: its
base class fixes the exit code of all commands (`granpinn.commands.shared.exit_codes`).
"""

from __future__ import annotations

import re
import warnings

# A flag, such as --max-time; not in a whole command line to copy.
FLAG = re.compile(r"(?<![\w-])--([A-Za-z][\w.-]*\w|\w)")
COMMAND = re.compile(r"granpinn[ .][a-z]+ ")


def in_python(text: str) -> str:
    """A text with names of Python in place of flags."""
    text = text.replace("--help explains", "help(granpinn.Config) explains")
    return FLAG.sub(lambda flag: flag[1].replace("-", "_"), text)


class Sentence(Exception):
    """An error whose message is written with the flags of the commands.

    In Python it has the names of arguments and settings instead: `max_time` for --max-time.
    """

    def __str__(self) -> str:
        text = self.for_commands
        return text if COMMAND.search(text) else in_python(text)

    @property
    def for_commands(self) -> str:
        """The message with flags."""
        return super().__str__()


class FlowFileWarning(UserWarning):
    """A flow can be used, but something in it is likely to be wrong; a command prints one line."""


def warn(text: str) -> None:
    """Warns of something in a flow."""
    warnings.warn(text, FlowFileWarning, stacklevel=4)


class BadInput(Sentence, ValueError):
    """What was given cannot be used: exit code 2. The message is one sentence with the remedy."""


class CannotGoOn(Sentence, RuntimeError):
    """The input is fine, but the work cannot be finished: exit code 1."""


def memory_sentence(error: BaseException) -> str | None:
    """The sentence for memory that NumPy or torch could not get; None for another error."""
    text = " ".join(str(error).split())
    known = isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError"
    if not known and "can't allocate memory" not in text:  # a RuntimeError of torch on a CPU
        return None
    return "there is not enough memory" + (f" ({text})" if text else "")


class Interrupted(KeyboardInterrupt):
    """SIGINT, SIGTERM or SIGHUP arrived; the message says what has been saved.

    Attributes:
        signum: number of the signal; the exit code is 128 more.
    """

    def __init__(self, signum: int, message: str) -> None:
        super().__init__(message)
        self.signum = signum
