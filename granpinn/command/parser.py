"""The parser of the commands: its errors are one sentence."""

from __future__ import annotations

import argparse
import difflib
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from granpinn.errors import BadInput

PACKAGE = Path(__file__).parent.parent


def program(verb: str) -> str:
    """The command as it was called: `granpinn VERB` or `python -m granpinn.VERB`."""
    called = Path(sys.argv[0])
    inside = PACKAGE in called.parents and called != PACKAGE / "__main__.py"
    return f"python -m granpinn.{verb}" if inside else f"granpinn {verb}"


class Parser(argparse.ArgumentParser):
    """Raises BadInput where argparse would print the usage and exit."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As in argparse; an unknown flag comes with the nearest one.

        No argument of any command may be empty: an empty path would be the current folder.
        """
        words = sys.argv[1:] if args is None else args
        for word in words:
            if not word or (word.startswith("--") and word.endswith("=")):
                self.error(f"every argument must have a value, got {word!r}")
        found, rest = self.parse_known_args(args, namespace)
        if rest:
            self.error(f"unrecognized arguments: {' '.join(rest)}{self._meant(rest)}")
        return found

    def error(self, message: str) -> NoReturn:
        raise BadInput(f"{message}; {self.prog} --help explains every argument")

    def _meant(self, rest: Sequence[str]) -> str:
        flags = [word.partition("=")[0] for word in rest if word.startswith("--")]
        near = nearest(flags[0], self._option_string_actions) if flags else None
        return "" if near is None else f": did you mean {near}?"


def nearest(flag: str, known: Iterable[str]) -> str | None:
    """The known flag that is most like `flag`, whose group may be missing; None without one."""
    names = {name: name for name in known}
    for name in [*names]:
        names.setdefault(f"--{name.rpartition('.')[2].lstrip('-')}", name)
    near = difflib.get_close_matches(flag.replace("_", "-"), names, n=1)
    near = near or difflib.get_close_matches(flag, names, n=1)
    return names[near[0]] if near else None
