"""The command `python -m granpinn.export RUN --to PROGRAM`: the law as input of a simulation.

It prints the file, or writes it with `--out`. In Python: `granpinn.load("run").export("chrono")`.

Exit codes: 0 done; 2 the folder holds no valid run, or the program cannot take its law; 1 the file
cannot be written.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("export")

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.parser import Parser
from granpinn.results import read_results
from granpinn.results.export import FORMATS


def parser() -> Parser:
    made = Parser(
        "export",
        "RUN --to PROGRAM [--out FILE]",
        "Write the law of a finished run as input of another program.",
    )
    made.add_argument("folder", metavar="RUN", type=Path, help="the run folder")
    made.add_argument("--to", required=True, choices=FORMATS, help="the program, or json")
    made.add_argument(
        "--out", metavar="FILE", type=Path, default=None, help="the file; none: it is printed"
    )
    return made


def run(argv: Sequence[str]) -> int:
    options = parser().parse_args(argv)
    text = read_results(options.folder / "results.json").export(options.to, options.out)
    print(text.removesuffix("\n") if options.out is None else f"law: {options.out}")
    return 0


main = partial(exit_code, "export", run)
