"""The report of a run: `python -m granpinn.report DIR`.

It reads only the run folder: results.json, and fields.h5 and history.csv if they are there.
It writes figures/*.png and report.html, one page that needs no other file and no
network. The page lists what is missing.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.commands.shared import cli

    cli.start("report")

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from granpinn.commands.shared.exit_codes import exit_code
from granpinn.commands.shared.parser import Parser
from granpinn.config.fields import Setting
from granpinn.output import owned

SETTINGS = {
    "time": Setting(
        float | None,
        None,
        "time of maps, in the unit of the flow file; default 0.7 of the last",
    ),
}


def parser() -> Parser:
    made = Parser(
        "report",
        "DIR [--time T]",
        "Draw the figures of a finished run and write its report.html.",
    )
    made.add_argument("folder", type=Path, help="the run folder, --out of granpinn.train")
    made.add_settings(SETTINGS)
    return made


def run(argv: Sequence[str]) -> int:
    given = vars(parser().parse_args(argv))
    from granpinn.identification.identified import load  # torch is slow to import

    folder, time = given["folder"], given.get("time")
    with owned(folder if folder.is_dir() else None):
        print(load(folder).report(time=time))
    return 0


main = partial(exit_code, "report", run)
