"""The command reference: what `--help` of every command prints, taken from the command itself."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
from collections.abc import Iterator
from typing import Any
from unittest import mock

from granpinn.commands.shared.cli import VERBS

WIDTH = 100  # characters of a line of help


def reference() -> str:
    """The sections of all commands."""
    return "\n".join(section(name) for name in VERBS)


def section(name: str) -> str:
    """Heading, the docstring of the module and the help."""
    module = importlib.import_module(f"granpinn.commands.{name}")
    text = "\n\n".join(paragraphs(module.__doc__ or ""))
    return f"## granpinn.{name}\n\n{text}\n\n```text\n{help_of(module)}\n```\n"


def paragraphs(docstring: str) -> Iterator[str]:
    """Those of a docstring for people at the command line: all but indented blocks."""
    for text in re.split(r"\n\s*\n", docstring.strip()):
        if not text.startswith(" "):
            yield " ".join(text.replace("``", "`").split())


def help_of(module: Any) -> str:
    """What the command prints with --help-all if it has that, else with --help."""
    text = printed_by(module, "--help")
    return printed_by(module, "--help-all") if "--help-all" in text else text


def printed_by(module: Any, flag: str) -> str:
    """What the command prints with a flag."""
    printed = io.StringIO()
    plain = {"COLUMNS": str(WIDTH), "NO_COLOR": "1"}
    with mock.patch.dict(os.environ, plain), contextlib.redirect_stdout(printed):
        try:
            module.main([flag])
        except SystemExit as end:
            if end.code:
                raise
    return printed.getvalue().strip()
