"""Text for a terminal: nothing in it may act as a command of the terminal.

Names of files and texts from files reach the terminal in many sentences. Everything that a command
writes to stdout goes through `visible`, and so do its sentences on stderr, with `say`.
"""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path

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


def shell_word(path: Path) -> str:
    """A path as one word of a shell, which no command in its name can leave; never a flag."""
    text = str(path)
    text = f"./{text}" if text.startswith("-") else text
    if text.isprintable() and text == " ".join(text.split()):  # errors join runs of blanks
        return shlex.quote(text)
    return f"$'{''.join(map(_escaped, text))}'"


def _escaped(character: str) -> str:
    """A character between $' and '."""
    if character.isprintable() and character not in " \\'":
        return character
    return "".join(f"\\x{byte:02x}" for byte in os.fsencode(character))
