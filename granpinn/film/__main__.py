"""The command `python -m granpinn.film`: from the frames of a film to a flow file.

Exit codes: 0 done; 2 bad or impossible input; 1 the flow file cannot be written.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("film")

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from granpinn.command import flow_warnings
from granpinn.command.conversion import add_flags, check_out, joined, write_checked
from granpinn.command.parser import Parser, program
from granpinn.foreign import installed
from granpinn.importers import DataFileError

EXAMPLES = """examples:
  python -m granpinn.film frames/*.png --out flow.h5 --scale "0.12 mm/px" --frame-rate "1500 Hz" \\
      --grain-diameter "0.8 mm" --grain-density "2500 kg/m^3" --solid-fraction 0.6
  python -m granpinn.film film.avi --out flow.h5 --roi 40:900,0:400 --mask walls.png ...

It writes FLOW.html too: one picture for every stage. docs/guides/films.md shows them."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    return exit_codes.exit_code("film", lambda: _run(sys.argv[1:] if argv is None else argv))


def _run(argv: Sequence[str]) -> int:
    if not installed("cv2"):
        raise DataFileError("films need OpenCV: pip install 'granpinn[film]'")
    from granpinn.film.measurement import WITHOUT, FilmSettings, measure
    from granpinn.film.page import write

    parser = Parser(
        prog=program("film"),
        usage="%(prog)s FRAMES... --out FLOW.h5 [settings]",
        description="Track the grains of a film and write a flow file.",
        epilog=EXAMPLES.replace("python -m granpinn.film", program("film")),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
        allow_abbrev=False,
    )
    parser.add_argument("sources", nargs="+", metavar="FRAMES", help="images, or one video")
    parser.add_argument("--out", required=True, metavar="FLOW.h5", help="the flow file to write")
    add_flags(parser, FilmSettings, WITHOUT)
    given = vars(parser.parse_args(joined(argv)))
    sources, out = [Path(s) for s in given.pop("sources")], Path(given.pop("out"))
    check_out(out, sources)
    settings = FilmSettings(**given)
    with flow_warnings.in_one_line():
        measured = measure(sources, settings, print)
        page = out.with_suffix(".html")
        write(measured, page)
        print(f"pictures of every stage: {page}")
        step = write_checked(measured.flow, out, settings.force)
    print(f"flow file: {out}")
    print(f"next: {step}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
