"""The console command: `granpinn VERB ...` is the same as `python -m granpinn.VERB ...`.

A verb is a module of granpinn/commands/ with a row in `VERBS`. It is imported when it is used, so
that `granpinn --help` is quick. The exit code comes from the verb; it is 2 for an unknown verb.
"""

from __future__ import annotations

import difflib
import importlib
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

import granpinn
from granpinn.commands.shared import exit_codes
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
        "draw the figures and the page of a finished run again",
        "granpinn report run",
    ),
    "export": Verb(
        "write the law of a finished run as input of OpenFOAM, Basilisk or Chrono, or as JSON",
        "granpinn export run --to openfoam --out transportProperties",
    ),
    "simulate": Verb(
        "simulate a collapse or a chute with a known friction law, to a flow file",
        "granpinn simulate --mu-s 0.4 --mu-2 0.64 --out collapse.h5",
    ),
    "doctor": Verb(
        "show what is installed, and which kernels run",
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


def command(verb: str) -> Any:
    """The module of a verb, which is imported here: its `parser`, and `main`, which runs it."""
    return importlib.import_module(f"granpinn.commands.{verb}")


def start(verb: str) -> NoReturn:
    """`python -m granpinn.VERB`: run the command with the words of this process, and end it."""
    exit_codes.guard_process(verb)
    sys.exit(command(verb).main(sys.argv[1:]))


def main(argv: Sequence[str] | None = None) -> int:
    """Run a verb; returns its exit code. Without `argv`, the words of this process."""
    words = list(sys.argv[1:] if argv is None else argv)
    verb = words[0] if words and words[0] in VERBS else ""
    if argv is None:
        exit_codes.guard_process(verb)
    if verb:
        code: int = command(verb).main(words[1:])
        return code
    return exit_codes.exit_code(verb, _without_verb, words)


def _without_verb(words: Sequence[str]) -> int:
    """Help and version."""
    if not words or words[0] in ("-h", "--help", "help"):
        print(help_text())
        return 0
    if words[0] in ("-V", "--version"):
        print(f"granpinn {granpinn.__version__}")
        return 0
    near = difflib.get_close_matches(words[0], VERBS, n=1)
    hint = f"did you mean granpinn {near[0]}?" if near else "granpinn --help lists them"
    raise BadInput(f"expected one of {', '.join(VERBS)}, got {words[0]!r}: {hint}")


def help_text() -> str:
    """The text of `granpinn --help`."""
    lines = ["usage: granpinn VERB [arguments]", "", PURPOSE, "", "verbs:"]
    for name, verb in VERBS.items():
        lines += [f"  {name:<12}{verb.does}", f"  {'':<12}  {verb.example}"]
    return "\n".join([*lines, "", FIRST_STEPS])
