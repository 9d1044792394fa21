"""The command `granpinn completion SHELL`: a script that completes verbs, flags and their choices.

The script is made from the parsers of all verbs. Completion itself starts no Python.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("completion")

import argparse
from collections.abc import Sequence
from functools import partial

import shtab

from granpinn.commands.shared.cli import VERBS, command
from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.parser import Parser

SHELLS = ("bash", "zsh", "fish")
EXAMPLES = """put this line into ~/.bashrc, or the same with zsh into ~/.zshrc:
  eval "$(granpinn completion bash)"
or this line into ~/.config/fish/config.fish:
  granpinn completion fish | source"""


def parser() -> Parser:
    made = Parser("completion", "SHELL", "Print the completion script of a shell.", EXAMPLES)
    made.add_argument("shell", choices=SHELLS, help="the shell")
    return made


def run(argv: Sequence[str]) -> int:
    shell = parser().parse_args(argv).shell
    print(script(shell, {verb: command(verb).parser() for verb in VERBS}))
    return 0


def script(shell: str, parsers: dict[str, Parser]) -> str:
    """The completion script of a shell for the parsers of the verbs."""
    program = argparse.ArgumentParser("granpinn")
    verbs = program.add_subparsers()
    for verb, made in parsers.items():
        for action in made._actions:
            stated = made.settings.get(action.dest)
            if stated is not None and stated.choices:
                action.choices = tuple(stated.choices)
            elif action.nargs != 0 and action.choices is None:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
        help = VERBS[verb].does if verb in VERBS else None
        verbs.add_parser(verb, parents=[made], add_help=False, help=help)
    return shtab.complete(program, shell)


main = partial(exit_code, "completion", run)
