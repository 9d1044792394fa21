"""The command `python -m granpinn.collect RUN...`: many finished runs as one table.

A word is a run folder, or a folder with runs below it. The terminal gets a line for each run: its
friction in the middle of its range of log I, and the grade of its assessment. `--out` writes a CSV
with the row of each results.csv, and with the run before it.

Exit codes: 0 done; 2 bad input; 1 a run could not be read, or the table cannot be written.
"""

from __future__ import annotations

if __name__ == "__main__":
    from granpinn.command import cli

    cli.start("collect")

from collections.abc import Iterator, Sequence
from pathlib import Path

from granpinn.command.cli import Command
from granpinn.command.parser import Parser
from granpinn.config import ConfigError
from granpinn.errors import BadInput
from granpinn.output import objection_to_file
from granpinn.results import ResultsFileError, read_results
from granpinn.results.results_file import Cell, row, write_table
from granpinn.terminal import say

RESULTS = "results.json"
# Columns of results.csv: I in the middle of its range, and mu there with its band.
MIDDLE = ("I_middle", "mu_at_I_middle", "mu_at_I_middle_low_90", "mu_at_I_middle_high_90")
EXAMPLES = """examples:
  python -m granpinn.collect runs --out table.csv
      all runs below a folder, such as those of a job array
  python -m granpinn.collect monday tuesday
      two runs, in the terminal alone"""


def parser() -> Parser:
    made = Parser(
        "collect",
        "RUN... [--out FILE.csv]",
        "Collect the results of finished runs in one table.",
        EXAMPLES,
    )
    made.add_argument(
        "runs", metavar="RUN", type=Path, nargs="+", help="a run folder, or one with runs below it"
    )
    made.add_argument(
        "--out", metavar="FILE.csv", type=Path, default=None, help="file for the table"
    )
    return made


def run(argv: Sequence[str]) -> int:
    options = parser().parse_args(argv)
    if options.out is not None and (objection := objection_to_file(options.out)):
        raise ConfigError(f"--out {objection}")
    rows, unread = collected(options.runs)
    if options.out is not None:
        write_table(rows, options.out)
    for cells in rows:
        print(line(cells))
    for sentence in unread:
        say(f"granpinn.collect: {sentence}")
    if options.out is not None:
        print(f"{len(rows)} runs: {options.out}")
    return 1 if unread else 0


def collected(folders: Sequence[Path]) -> tuple[list[dict[str, Cell]], list[str]]:
    """The rows of all runs, each run once, and a sentence for each that cannot be read.

    Raises:
        BadInput: a folder does not exist, or has no run.
    """
    found: dict[Path, None] = {}
    for folder in folders:
        below = dict.fromkeys(runs_in(folder))
        if not below:
            missing = "has no finished run (results.json)" if folder.is_dir() else "is no folder"
            raise BadInput(f"{folder} {missing}: name the --out of granpinn.train, or one above")
        found |= below
    rows: list[dict[str, Cell]] = []
    unread = []
    for run in found:
        try:
            result = read_results(run / RESULTS)
        except ResultsFileError as error:
            unread.append(str(error))
            continue
        rows.append({"run": str(run), **row(result)})
    return rows, unread


def runs_in(folder: Path) -> Iterator[Path]:
    """The run folders in a folder, by name: itself, or those below it but not inside of a run."""
    if (folder / RESULTS).is_file():
        yield folder
    elif folder.is_dir():
        for part in sorted(folder.iterdir()):
            if part.is_dir() and not part.is_symlink():
                yield from runs_in(part)


def line(cells: dict[str, Cell]) -> str:
    """A run in the terminal."""
    I, mu, low, high = (cells[name] for name in MIDDLE)
    words = f"{cells['run']}: {cells['law']}, "
    if not isinstance(mu, float):
        words += "mu not determined"
    elif low is None:
        words += f"mu = {mu:.3f} at I = {I:.2g}, error not determined"
    else:
        words += f"mu = {mu:.3f} ({low:.3f} to {high:.3f}) at I = {I:.2g}"
    return f"{words}; {cells['assessment']}"


main = Command("collect", parser, run)
