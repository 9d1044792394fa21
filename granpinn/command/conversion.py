"""What the commands that make a flow file share: arguments, checks, the file."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from granpinn.command.next_step import training_of
from granpinn.command.parser import Parser, program
from granpinn.config.fields import Setting
from granpinn.data import Flow, FlowFileWarning, write_flow
from granpinn.importers import DataFileError
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


def add_arguments(parser: Parser, sources: str, settings: Mapping[str, Setting]) -> None:
    """The files, --out and one flag for each setting.

    Args:
        sources: the files, in words.
    """
    parser.add_argument("sources", nargs="+", type=Path, metavar="IN", help=sources)
    parser.add_argument(
        "--out", required=True, type=Path, metavar="FLOW.h5", help="the flow file to write"
    )
    parser.add_settings(settings, GROUPS)


def parse(parser: Parser, argv: Sequence[str]) -> tuple[list[Path], Path, dict[str, Any]]:
    """Files, flow file and the settings that a command line gives.

    Raises:
        DataFileError: the flow file cannot be written, or is one of the files.
    """
    given = vars(parser.parse_args(argv))
    sources, out = given.pop("sources"), given.pop("out")
    if objection := objection_to_file(out):
        raise DataFileError(f"--out {objection}")
    if out.exists() and any(source.exists() and source.samefile(out) for source in sources):
        raise DataFileError(f"--out must be another file than the data, got {out}")
    return sources, out, given


def write(flow: Flow, out: Path, force: bool) -> None:
    """Write the flow file, with a warning for each slip, and print the command that comes next.

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
    print(f"flow file: {out}")
    step = f"{program('inspect')} {shell_word(out)}" if slips else training_of(flow, out)
    print(f"next: {step}")
