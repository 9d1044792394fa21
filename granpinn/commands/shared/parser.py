"""The parser of a command: settings of dataclasses become flags; an error is one sentence."""

from __future__ import annotations

import argparse
import sys
import typing
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from granpinn.config.fields import NONE, Setting, as_text, flag_of, most_like, without_none
from granpinn.errors import BadInput

PACKAGE = Path(__file__).parents[2]


def program(verb: str) -> str:
    """The command as it was called: `granpinn VERB` or `python -m granpinn.VERB`."""
    called = Path(sys.argv[0])
    inside = PACKAGE in called.parents and called != PACKAGE / "__main__.py"
    return f"python -m granpinn.{verb}" if inside else f"granpinn {verb}"


class Parser(argparse.ArgumentParser):
    """A parser in which every flag that is not given has no attribute in the namespace.

    A setting of the type bool is a switch: `--x` or `--no-x`.
    """

    def __init__(self, verb: str, usage: str, description: str, examples: str = "") -> None:
        super().__init__(
            prog=program(verb),
            usage=f"%(prog)s {usage}",
            description=description,
            epilog=examples.replace(f"python -m granpinn.{verb}", program(verb)),
            formatter_class=_Help,
            argument_default=argparse.SUPPRESS,
            allow_abbrev=False,
        )
        self.settings: dict[str, Setting] = {}  # by the names of their attributes

    def add_settings(
        self,
        settings: Mapping[str, Setting],
        groups: Mapping[str, str] | None = None,
        usual: Collection[str] | None = None,
    ) -> None:
        """One flag for each setting.

        Args:
            settings: by the names of their attributes, such as "network.widths".
            groups: descriptions of the groups of settings.
            usual: names that the help shows, without groups; None: it shows all.
        """
        places: dict[str, Any] = {}
        if usual is None:
            places = {
                name: self.add_argument_group(name, text) for name, text in (groups or {}).items()
            }
        for key, stated in settings.items():
            shape: dict[str, Any] = {"action": argparse.BooleanOptionalAction}
            if stated.kind is not bool:
                shape = {"metavar": metavar_of(stated)}
            text = _help_of(key, stated).replace("%", "%%")
            help = text if usual is None or key in usual else argparse.SUPPRESS
            places.get(stated.group, self).add_argument(flag_of(key), dest=key, help=help, **shape)
        self.settings |= settings

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As in argparse, with settings as values of their types.

        No argument of any command may be empty: an empty path would be the current folder.

        Raises:
            BadInput: the message is one sentence; an unknown flag comes with the nearest one.
        """
        words = self._joined(sys.argv[1:] if args is None else args)
        for word in words:
            if not word or (word.startswith("--") and word.endswith("=")):
                self.error(f"every argument must have a value, got {word!r}")
        found, rest = self.parse_known_args(words, namespace)
        if rest:
            self.error(f"unrecognized arguments: {' '.join(rest)}{self._meant(rest)}")
        for key, stated in self.settings.items():
            if key in found:
                setattr(found, key, stated.of_text(getattr(found, key), flag_of(key)))
        return found

    def _joined(self, words: Sequence[str]) -> list[str]:
        """The words with `--x=value` for every setting with a value, so that -1.2 is no flag."""
        flags = {flag_of(key) for key, stated in self.settings.items() if stated.kind is not bool}
        rest, made = list(words), []
        while rest:
            word = rest.pop(0)
            if word in flags and rest and not rest[0].startswith("--"):
                word = f"{word}={rest.pop(0)}"
            made.append(word)
        return made

    def error(self, message: str) -> NoReturn:
        raise BadInput(f"{message}; {self.prog} --help explains every argument")

    def _meant(self, rest: Sequence[str]) -> str:
        known = {flag.lstrip("-"): flag for flag in self._option_string_actions}
        flags = [word[2:].partition("=")[0] for word in rest if word.startswith("--")]
        near = most_like(flags[0], known) if flags else None
        return "" if near is None else f": did you mean {known[near]}?"


class _Help(argparse.RawDescriptionHelpFormatter):
    """Help with one line for the name and the rest for the explanation."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=30, width=100)


def metavar_of(stated: Setting) -> str:
    """The placeholder for the value of a setting in the help, such as {V0,V1,V2} or N."""
    if stated.metavar or stated.choices:
        return stated.metavar or "{" + ",".join(stated.choices) + "}"
    kind, _ = without_none(stated.kind)
    names = {int: "N", float: "X", str: "VALUE"}
    if typing.get_origin(kind) is not tuple:
        return names[kind]
    item = names[typing.get_args(kind)[0]]
    return f"{item},{item},..."


def _help_of(key: str, stated: Setting) -> str:
    value, text = stated.default, stated.help
    if stated.kind is bool:
        return f"{text} (on by default)" if value else text
    stated_default = value is not None or f"{NONE}:" in text
    return f"{text} (default {as_text(value)})" if stated_default else text
