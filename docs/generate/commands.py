"""The command reference: what `--help` of every command prints, taken from the command itself.

A command is a module of the package with a function `main` that `python -m` runs.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

PACKAGE = Path(__file__).parents[2] / "granpinn"
WIDTH = 100  # characters of a line of help
FIRST = ("convert", "inspect", "train", "report", "simulate")  # the order in which they are needed


def reference() -> str:
    """The sections of all commands."""
    return "\n".join(section(name) for name in commands(PACKAGE))


def commands(package: Path) -> list[str]:
    """Names of the commands, such as "train", the ones of `FIRST` first."""
    found = [
        name
        for path in [*package.glob("*.py"), *package.glob("*/__main__.py")]
        if (name := path.stem if path.parent == package else path.parent.name) and runs(path)
    ]
    return sorted(found, key=lambda name: (FIRST.index(name) if name in FIRST else 99, name))


def runs(path: Path) -> bool:
    """Whether a module has `main` and ends by calling it."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    has_main = any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in body)
    return has_main and any(
        isinstance(node, ast.If) and "__main__" in ast.unparse(node.test) for node in body
    )


def section(name: str) -> str:
    """Heading, the docstring of the module and the help."""
    module = module_of(name)
    text = "\n\n".join(paragraphs(module.__doc__ or ""))
    return f"## granpinn.{name}\n\n{text}\n\n```text\n{help_of(module)}\n```\n"


def module_of(name: str) -> Any:
    """The module of a command; that of a package is its __main__."""
    module = importlib.import_module(f"granpinn.{name}")
    return importlib.import_module(f"granpinn.{name}.__main__") if is_package(module) else module


def is_package(module: Any) -> bool:
    """Whether a module is a package."""
    return hasattr(module, "__path__")


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
