"""Command lines that a command proposes as the next step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from granpinn.command.parser import program
from granpinn.data import Flow
from granpinn.data.flow_file import is_flow_file
from granpinn.errors import BadInput
from granpinn.output import shell_word

CONVERT = (
    '--out flow.h5 --scale "0.12 mm/px" --frame-rate "500 Hz" --grain-diameter "0.8 mm" '
    '--grain-density "2500 kg/m^3" --solid-fraction 0.6'
)


def training_of(flow: Flow, path: Path) -> str:
    """The training of a flow file; level V0 where it has no free surface."""
    level = "" if flow.surface is not None else " --level V0"
    return f"{program('train')} {shell_word(path)} --out run{level}"


def refusal(paths: Sequence[Path], then: str) -> BadInput:
    """The error for the files of an instrument, with the command that converts them.

    Args:
        then: what to do with the flow file, such as "inspect".

    Raises:
        DataFileError: the files are of no known format.
    """
    # The importers are slow to import, and flow files do not need them.
    from granpinn.importers import DataFileError
    from granpinn.importers.series import detect

    first = paths[0]
    name = detect(first)
    sources = " ... ".join(shell_word(path) for path in dict.fromkeys((first, paths[-1])))
    return DataFileError(
        f"{first} is not a flow file but of the format {name}: convert it first, "
        f"{program('convert')} {sources} {CONVERT} (with your own numbers), and {then} flow.h5"
    )


def require_flow_file(path: Path) -> None:
    """DataFileError for a file of an instrument; other files are for the reader of flow files."""
    if not path.is_file() or is_flow_file(path):
        return
    try:
        error = refusal([path], "train on")
    except BadInput:  # of no known format
        return
    raise error
