"""The command `python -m granpinn.export RUN --to PROGRAM`: the law as input of a simulation.

It prints the file, or writes it with `--out`. In Python: `granpinn.load("run").export("chrono")`.

Exit codes: 0 done; 2 the folder holds no valid run, or the program cannot take its law; 1 the file
cannot be written.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("export")

import sys
from collections.abc import Sequence
from pathlib import Path

from granpinn.command.parser import Parser, program
from granpinn.results import read_results
from granpinn.results.export import FORMATS


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit code."""
    return exit_codes.exit_code("export", lambda: _run(sys.argv[1:] if argv is None else argv))


def _run(argv: Sequence[str]) -> int:
    parser = Parser(
        prog=program("export"),
        description="Write the law of a finished run as input of another program.",
    )
    parser.add_argument("folder", metavar="RUN", type=Path, help="the run folder")
    parser.add_argument("--to", required=True, choices=FORMATS, help="the program, or json")
    parser.add_argument("--out", metavar="FILE", type=Path, help="the file; none: it is printed")
    options = parser.parse_args(argv)
    text = read_results(options.folder / "results.json").export(options.to, options.out)
    print(text.removesuffix("\n") if options.out is None else f"law: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
