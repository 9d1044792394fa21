"""Text for a terminal: nothing in it may act as a command of the terminal.

Names of files and texts from files reach the terminal in many sentences. Everything that a command
writes to stdout goes through `visible`, and so do its sentences on stderr, with `say`.
"""

from __future__ import annotations

import sys

KEPT = frozenset("\n\t")


def visible(text: str) -> str:
    r"""The text with every character that cannot be printed in its escaped form, such as \x1b.

    Line ends and tabs stay.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in KEPT else ascii(c)[1:-1] for c in text)


def say(text: str) -> None:
    """Print a sentence to stderr."""
    print(visible(text), file=sys.stderr, flush=True)
