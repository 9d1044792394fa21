"""Flow files of commands: those they are given, those they write, and the command that is next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from granpinn.commands.shared.parser import Parser, program
from granpinn.config.fields import Setting
from granpinn.data import Flow, write_flow
from granpinn.data.flow_file import is_flow_file
from granpinn.errors import BadInput, warn
from granpinn.inspection import quick
from granpinn.output import require_file
from granpinn.results.record import IMPOSSIBLE
from granpinn.terminal import shell_word

GROUPS = {
    "files": "which files, and what of them",
    "calibration": "units: needed only where the files do not say",
    "frame": "axes: x to the right, y up",
    "flow": "where it does not change",
    "material": "the grains",
    "grains": "where the grains end",
}


CONVERT = (
    '--out flow.h5 --scale "0.12 mm/px" --frame-rate "500 Hz" --grain-diameter "0.8 mm" '
    '--grain-density "2500 kg/m^3" --solid-fraction 0.6'
)


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
        BadInput: the flow file is one of the files.
        OutputError: it cannot be written.
    """
    given = vars(parser.parse_args(argv))
    sources, out = given.pop("sources"), given.pop("out")
    require_file(out)
    if out.exists() and any(source.exists() and source.samefile(out) for source in sources):
        raise BadInput(f"--out must be another file than the data, got {out}")
    return sources, out, given


def write(flow: Flow, out: Path, force: bool) -> None:
    """Write the flow file, with a warning for each slip, and print the command that comes next.

    Raises:
        BadInput: the vectors are impossible, and `force` is not set.
    """
    slips = quick(flow).slips
    for slip in slips:
        warn(str(slip))
    if not force and any(slip.grade == IMPOSSIBLE for slip in slips):
        raise BadInput(
            "the vectors are impossible, as the warnings say, and no flow file was written: "
            "correct the units, scale, rate or axes, or give --force to write it all the same"
        )
    write_flow(flow, out)
    print(f"flow file: {out}")
    step = f"{program('inspect')} {shell_word(out)}" if slips else training_of(flow, out)
    print(f"next: {step}")


def training_of(flow: Flow, path: Path) -> str:
    """The training of a flow file; level V0 where it has no free surface."""
    level = "" if flow.surface is not None else " --level V0"
    return f"{program('train')} {shell_word(path)} --out run{level}"


def require_flow_files(paths: Sequence[Path], then: str) -> None:
    """Refuse files of an instrument; the reader of flow files refuses what is of no known format.

    Args:
        then: what to do with the flow file, such as "inspect".

    Raises:
        BadInput: the message has the command that converts the files.
    """
    others = [path for path in paths if path.is_file() and not is_flow_file(path)]
    if not others:
        return
    from granpinn.importers.series import detect  # slow to import

    try:
        name = detect(others[0])
    except BadInput:
        return
    sources = " ... ".join(shell_word(path) for path in dict.fromkeys((others[0], others[-1])))
    raise BadInput(
        f"{others[0]} is not a flow file but of the format {name}: convert it first, "
        f"{program('convert')} {sources} {CONVERT} (with your own numbers), and {then} flow.h5"
    )
