"""Run as a program: granpinn.train without its page, whose figures have their own tests."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from typing import Any

from granpinn.commands.shared import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("train")

from granpinn.commands.train import main


def pageless(command: Sequence[str]) -> list[str]:
    """The command line of a training with this program in the place of `-m granpinn.train`."""
    place = command.index("granpinn.train")
    return [*command[: place - 1], __file__, *command[place + 1 :]]


def stand_ins() -> list[tuple[Any, str, Any]]:
    """What takes the place of what makes the page: object, name of its attribute, value."""
    page = importlib.import_module("granpinn.figures.page")
    return [(page, "build", lambda run, folder, time: folder / "report.html")]


if __name__ == "__main__":
    for owner, name, value in stand_ins():
        setattr(owner, name, value)
    sys.exit(main(sys.argv[1:]))
