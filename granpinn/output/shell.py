"""Paths in command lines that are shown to be pasted into a shell."""

from __future__ import annotations

import os
import shlex
from pathlib import Path


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
