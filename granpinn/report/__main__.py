"""The report of a run: `python -m granpinn.report DIR`.

It reads the run folder alone: results.json, and fields.h5 and history.csv if they are there.
It writes results.csv, figures/*.png and report.html, one page that needs no other file and no
network. The page lists what is missing. With --paraview it writes fields.vtkhdf too.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("report")

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from granpinn.command.parser import Parser, program
from granpinn.config.values import number
from granpinn.errors import BadInput
from granpinn.output import owned
from granpinn.report.page import build, for_paraview


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; 0 done, 2 the folder holds no valid run, 1 it cannot be written to."""
    return exit_codes.exit_code("report", lambda: _run(sys.argv[1:] if argv is None else argv))


def _run(argv: Sequence[str]) -> int:
    parser = Parser(
        prog=program("report"),
        description="Draw the figures of a finished run and write its report.html.",
    )
    parser.add_argument("folder", help="the run folder, --out of granpinn.train")
    parser.add_argument(
        "--time",
        type=number,
        help="time of maps and profiles, in the unit of the flow file; default 0.7 of the last",
    )
    parser.add_argument(
        "--pdf", action="store_true", help="write the figures as PDF too, for talks"
    )
    parser.add_argument(
        "--paraview",
        action="store_true",
        help="write fields.vtkhdf too, the fields over time for ParaView",
    )
    arguments = parser.parse_args(argv)
    if arguments.time is not None and not math.isfinite(arguments.time):
        raise BadInput(f"--time must be a finite number, got {arguments.time}")
    folder = Path(arguments.folder)
    with owned(folder if folder.is_dir() else None):
        print(build(folder, arguments.time, arguments.pdf))
        if arguments.paraview:
            print(for_paraview(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
