"""What the commands that make flow files share: flags of the conversion, checks, the flow file."""

from __future__ import annotations

import argparse
import dataclasses
import warnings
from collections.abc import Sequence
from pathlib import Path

from granpinn.command.next_step import training_of
from granpinn.command.parser import program
from granpinn.config.fields import flag_of
from granpinn.config.values import number, whole
from granpinn.data import Flow, FlowFileWarning, write_flow
from granpinn.importers import DataFileError, Settings
from granpinn.inspection import quick
from granpinn.output import objection_to_file, shell_word
from granpinn.results.record import IMPOSSIBLE

GROUPS = {
    "files": "which files, and what of them",
    "calibration": "units: needed only where the files do not say",
    "frame": "axes: x to the right, y up",
    "flow": "where it does not change",
    "material": "the grains",
    "grains": "where the grains end",
}


def add_flags(
    parser: argparse.ArgumentParser, record: type[Settings], without: Sequence[str] = ()
) -> None:
    """One flag for every field of the settings but those of the names `without`."""
    stated = [f for f in dataclasses.fields(record) if f.name not in without]
    used = {f.metadata["group"] for f in stated}
    groups = {n: parser.add_argument_group(n, text) for n, text in GROUPS.items() if n in used}
    for field in stated:
        text = field.metadata["help"].replace("%", "%%")
        group, flag = groups[field.metadata["group"]], flag_of(field.name)
        if str(field.type) == "bool":
            group.add_argument(flag, dest=field.name, action="store_true", help=text)
            continue
        if field.default is not None:
            text += f" (default {field.default})"
        kind = {"int": whole, "float | None": number}.get(str(field.type), str)
        group.add_argument(flag, dest=field.name, metavar="VALUE", type=kind, help=text)


def joined(argv: Sequence[str]) -> list[str]:
    """`--tilt "-1.2 deg"` as one argument, because argparse takes -1.2 for a flag."""
    words: list[str] = []
    for argument in argv:
        negative = argument[:1] == "-" and argument[1:2].isdigit()
        if negative and words and words[-1].startswith("--") and "=" not in words[-1]:
            words[-1] += f"={argument}"
        else:
            words.append(argument)
    return words


def check_out(out: Path, sources: Sequence[Path]) -> None:
    """DataFileError if the flow file cannot be written, or is one of the sources."""
    if objection := objection_to_file(out):
        raise DataFileError(f"--out {objection}")
    if out.exists() and any(source.exists() and source.samefile(out) for source in sources):
        raise DataFileError(f"--out must be another file than the data, got {out}")


def write_checked(flow: Flow, out: Path, force: bool) -> str:
    """Writes the flow file, with a warning for each slip; the command that comes next.

    Raises:
        DataFileError: the vectors are impossible, and `force` is not set.
    """
    slips = quick(flow).slips
    for slip in slips:
        warnings.warn(str(slip), FlowFileWarning, stacklevel=3)
    if not force and any(slip.grade == IMPOSSIBLE for slip in slips):
        raise DataFileError(
            "the vectors are impossible, as the warnings say, and no flow file was written: "
            "correct the units, scale, rate or axes, or give --force to write it all the same"
        )
    write_flow(flow, out)
    return f"{program('inspect')} {shell_word(out)}" if slips else training_of(flow, out)
