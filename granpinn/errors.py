"""The errors that end a command, by what the user can do about them.

Every error class of granpinn derives from one of these, so a new error needs no further entry: its
base class fixes the exit code of all commands (`granpinn.command.exit_codes`).
"""

from __future__ import annotations


class BadInput(ValueError):
    """What was given cannot be used: exit code 2. The message is one sentence with the remedy."""


class CannotGoOn(RuntimeError):
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
