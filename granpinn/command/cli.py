"""The console command: `granpinn VERB ...` is the same as `python -m granpinn.VERB ...`.

A verb is imported when it is used, so that `granpinn --help` is quick. The exit code comes from the
verb; it is 2 for an unknown verb.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence
from typing import NamedTuple

import granpinn
from granpinn.command import completion, exit_codes
from granpinn.errors import BadInput


class Verb(NamedTuple):
    """One line of the help, and a command to start from."""

    does: str
    example: str


# In the order of an experiment.
VERBS = {
    "convert": Verb(
        "turn files of a PIV, PTV or simulation program into a flow file",
        'granpinn convert PIVlab_*.txt --out flow.h5 --scale "0.12 mm/px" ...',
    ),
    "film": Verb(
        "track the grains of a film, images or a video, into a flow file",
        'granpinn film frames/*.png --out flow.h5 --scale "0.12 mm/px" ...',
    ),
    "inspect": Verb(
        "check data before training: the precision to expect, and what to measure better",
        "granpinn inspect flow.h5",
    ),
    "train": Verb(
        "identify the friction law and the pressure; without arguments a demonstration",
        "granpinn train flow.h5 --out run",
    ),
    "report": Verb(
        "draw the figures and the page of a finished run again; write its fields for ParaView",
        "granpinn report run --paraview",
    ),
    "collect": Verb(
        "collect the results of many finished runs in one table",
        "granpinn collect runs --out table.csv",
    ),
    "simulate": Verb(
        "simulate a collapse, a chute or a silo with a known friction law, to a flow file",
        "granpinn simulate --mu-s 0.4 --mu-2 0.64 --out collapse.h5",
    ),
    "tables": Verb(
        "run the tables of the paper again and compare them with its numbers",
        "granpinn tables --out tables",
    ),
    "doctor": Verb(
        "show what is installed, which kernels run and why",
        "granpinn doctor",
    ),
    "completion": Verb(
        "print the completion script of a shell: bash, zsh or fish",
        'eval "$(granpinn completion bash)"',
    ),
}
PURPOSE = "Identifies the friction law and the pressure field of a granular flow from its velocity."
FIRST_STEPS = """first steps:
  granpinn doctor                       check the installation
  granpinn train                        a demonstration, in a few minutes
  granpinn convert ... --out flow.h5    your own measurement
  granpinn train flow.h5 --out run      the result is run/report.html

granpinn VERB --help explains every argument; python -m granpinn.VERB is the same command."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a verb; returns its exit code. Without `argv`, the words of this process."""
    words = list(sys.argv[1:] if argv is None else argv)
    verb = words[0] if words and words[0] in VERBS else ""
    if argv is None:
        exit_codes.guard_process(verb)
    if verb not in ("", "completion") and verb in available():
        return command(verb)(words[1:])
    return exit_codes.exit_code(verb, lambda: _own(words))


def _own(words: Sequence[str]) -> int:
    """Help, version and completion, which are no command of their own."""
    if not words or words[0] in ("-h", "--help", "help"):
        print(help_text())
        return 0
    if words[0] in ("-V", "--version"):
        print(f"granpinn {granpinn.__version__}")
        return 0
    verbs = available()
    if words[0] != "completion":
        raise BadInput(_unknown(words[0], verbs))
    commands = {name: command(name) for name in verbs if name != "completion"}
    return completion.main(words[1:], commands)


def available() -> list[str]:
    """The verbs of this installation."""
    return [name for name in VERBS if name == "completion" or _module(name) is not None]


def command(verb: str) -> Callable[[Sequence[str]], int]:
    """The function behind a verb, loaded when it is called: arguments -> exit code."""

    def run(argv: Sequence[str]) -> int:
        name = _module(verb)
        assert name is not None
        return int(importlib.import_module(name).main(argv))

    return run


def help_text() -> str:
    """The text of `granpinn --help`."""
    lines = ["usage: granpinn VERB [arguments]", "", PURPOSE, "", "verbs:"]
    for name in available():
        lines += [f"  {name:<12}{VERBS[name].does}", f"  {'':<12}  {VERBS[name].example}"]
    return "\n".join([*lines, "", FIRST_STEPS])


def _module(verb: str) -> str | None:
    """The module of a verb: granpinn.VERB, or __main__ in a package of that name."""
    spec = importlib.util.find_spec(f"granpinn.{verb}")
    if spec is None:
        return None
    return f"granpinn.{verb}" + (".__main__" if spec.submodule_search_locations else "")


def _unknown(word: str, verbs: Sequence[str]) -> str:
    near = difflib.get_close_matches(word, verbs, n=1)
    hint = f"did you mean granpinn {near[0]}?" if near else "granpinn --help lists them"
    return f"expected one of {', '.join(verbs)}, got {word!r}: {hint}"
