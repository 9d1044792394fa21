"""The command `python -m granpinn.convert`: makes a flow file of the files of a PIV or PTV program.

Exit codes: 0 done; 2 bad or impossible input, without --force; 1 the flow file cannot be written.

In Python, `granpinn.read(files, ...)` gives the flow, and `granpinn.convert(files, settings)` takes
the settings as a record.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("convert")

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granpinn.command import flow_warnings
from granpinn.command.callable_module import call_like
from granpinn.command.conversion import add_flags, check_out, joined, write_checked
from granpinn.command.parser import Parser, program
from granpinn.importers import Settings, convert
from granpinn.importers.formats import FORMATS

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


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""

    def run() -> int:
        sources, out, settings = parse(sys.argv[1:] if argv is None else argv)
        with flow_warnings.in_one_line():
            flow = convert(sources, settings, report=print)
            step = write_checked(flow, out, settings.force)
        print(f"flow file: {out}")
        print(f"next: {step}")
        return 0

    return exit_codes.exit_code("convert", run)


def parse(argv: Sequence[str]) -> tuple[list[Path], Path, Settings]:
    """Files, flow file and settings of a command line."""
    examples = EXAMPLES.replace("python -m granpinn.convert", program("convert"))
    parser = Parser(
        prog=program("convert"),
        usage="%(prog)s IN... --out FLOW.h5 [settings]",
        description="Turn files of a PIV, PTV or simulation program into a flow file.",
        epilog=f"{examples}\n\nformats:\n{_formats()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
        allow_abbrev=False,
    )
    parser.add_argument("sources", nargs="+", metavar="IN", help="files, folders or patterns")
    parser.add_argument("--out", required=True, metavar="FLOW.h5", help="the flow file to write")
    add_flags(parser, Settings)
    given: dict[str, Any] = vars(parser.parse_args(joined(argv)))
    sources = [Path(source) for source in given.pop("sources")]
    out = Path(given.pop("out"))
    check_out(out, sources)
    return sources, out, Settings(**given)


def _formats() -> str:
    return "\n".join(f"  {name:<12}{found.title}" for name, found in FORMATS.items())


call_like(convert, __name__)

if __name__ == "__main__":
    sys.exit(main())
