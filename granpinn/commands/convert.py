"""The command `python -m granpinn.convert`: makes a flow file of the files of a PIV or PTV program.

Exit codes: 0 done; 2 bad or impossible input, without --force; 1 the flow file cannot be written.

In Python, `granpinn.read(files, ...)` gives the flow, and `granpinn.convert(files, settings)` takes
the settings as a record.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.command import cli

    cli.start("convert")

import warnings
from collections.abc import Sequence
from pathlib import Path

from granpinn.command import flow_warnings
from granpinn.command.cli import Command
from granpinn.command.next_step import training_of
from granpinn.command.parser import Parser, program
from granpinn.config import settings_of
from granpinn.data import FlowFileWarning, write_flow
from granpinn.importers import DataFileError, Settings, convert
from granpinn.importers.formats import FORMATS
from granpinn.inspection import quick
from granpinn.output import objection_to_file, shell_word
from granpinn.results.record import IMPOSSIBLE

EXAMPLES = """examples:
  python -m granpinn.convert run/PIVlab_*.txt --out flow.h5 --scale "0.12 mm/px" \\
      --frame-rate "500 Hz" --grain-diameter "0.8 mm" --grain-density "2500 kg/m^3" \\
      --solid-fraction 0.6
      vectors in pixels per frame, one file per frame, a mask drawn in PIVlab
  python -m granpinn.convert tracks.csv --out flow.h5 --surface surface.csv --scale "8.3 px/mm" ...
      tracked particles: velocities by local polynomials; the line of the free surface by hand
  python -m granpinn.convert B*.vc7 --out flow.h5 --tilt "-1.2 deg" --wall-gap "20 mm" ...
      DaVis, already in mm and m/s; a plumb line in the image leans 1.2 degrees to the left
  python -m granpinn.convert out-*.txt --out flow.h5 --dimensionless --times name \\
      --grain-diameter 0.025
      a simulation without units, times in the names of the files

units: any that make sense ("0.12 mm/px", "8.3 px/mm", "2 ms", "2.5 g/cm^3"); the flow file has SI.
What is missing is named. docs/guides/importing.md has the steps for every instrument."""

GROUPS = {
    "files": "which files, and what of them",
    "calibration": "units: needed only where the files do not say",
    "frame": "axes: x to the right, y up",
    "flow": "where it does not change",
    "material": "the grains",
    "grains": "where the grains end",
}


def parser() -> Parser:
    formats = "\n".join(f"  {name:<12}{found.title}" for name, found in FORMATS.items())
    made = Parser(
        "convert",
        "IN... --out FLOW.h5 [settings]",
        "Turn files of a PIV, PTV or simulation program into a flow file.",
        f"{EXAMPLES}\n\nformats:\n{formats}",
    )
    made.add_argument(
        "sources", nargs="+", type=Path, metavar="IN", help="files, folders or patterns"
    )
    made.add_argument(
        "--out", required=True, type=Path, metavar="FLOW.h5", help="the flow file to write"
    )
    made.add_settings(settings_of(Settings), GROUPS)
    return made


def parse(argv: Sequence[str]) -> tuple[list[Path], Path, Settings]:
    """Files, flow file and settings of a command line."""
    given = vars(parser().parse_args(argv))
    sources, out = given.pop("sources"), given.pop("out")
    if objection := objection_to_file(out):
        raise DataFileError(f"--out {objection}")
    if out.exists() and any(source.exists() and source.samefile(out) for source in sources):
        raise DataFileError(f"--out must be another file than the data, got {out}")
    return sources, out, Settings(**given)


def run(argv: Sequence[str]) -> int:
    sources, out, settings = parse(argv)
    with flow_warnings.in_one_line():
        flow = convert(sources, settings, report=print)
        slips = quick(flow).slips
        for slip in slips:
            warnings.warn(str(slip), FlowFileWarning, stacklevel=2)
        if not settings.force and any(slip.grade == IMPOSSIBLE for slip in slips):
            raise DataFileError(
                "the vectors are impossible, as the warnings say, and no flow file was written: "
                "correct the units, scale, rate or axes, or give --force to write it all the same"
            )
        write_flow(flow, out)
    print(f"flow file: {out}")
    step = f"{program('inspect')} {shell_word(out)}" if slips else training_of(flow, out)
    print(f"next: {step}")
    return 0


main = Command("convert", parser, run)
