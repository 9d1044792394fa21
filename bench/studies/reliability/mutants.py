"""Runs commands on damaged files: gates F-1, F-2 and F-4.

    python -m bench.studies.reliability.mutants --format flow --command train --seeds 0:99 --jobs 2
    python -m bench.studies.reliability.mutants --format flow --command train --only 17 --keep out

A mutant is a function of format, command and its name. The name is a seed, or several: "17/4" is
mutant 4 of mutant 17, which was kept because it reached new places in the readers.

Rows are written while it runs, to FILE.rows beside --out FILE.json. They are not lost if the run
is killed, and rows.py makes one record of several runs.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.studies.reliability import preload, rows
from bench.studies.reliability.record import RESULTS, command_of
from bench.studies.reliability.samples import FORMATS

MODULE = "bench.studies.reliability.mutants"
SOURCE = Path(__file__).with_name("opens.c")


def main(argv: list[str] | None = None) -> int:
    """Run the mutants, write the record; exit code 1 if one of them ended as it must not."""
    options = parse(sys.argv[1:] if argv is None else argv)
    if options.worker is not None:
        from bench.studies.reliability.worker import work

        first, step = options.worker
        work(chosen(options), range(*options.seeds)[first::step], options)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows" if options.out is None else options.out.with_suffix(".rows")
        rows.begin(path, command_of(MODULE, argv))
        workers = started(options, Path(folder), path)
        ended = [worker.wait() for worker in workers]
        whole = rows.merged([path])
    if any(ended):
        print("a worker ended early: its mutants are missing", file=sys.stderr)
        whole["details"]["workers that ended early"] = sum(map(bool, ended))
    if options.out is not None:
        rows.write(options.out, whole)
    rows.show(whole)
    return int(bool(whole["failed"]) or any(ended))


def parse(argv: list[str]) -> argparse.Namespace:
    """The options of a command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--format", nargs="*", default=list(FORMATS), choices=list(FORMATS))
    parser.add_argument("--command", nargs="*", help="such as train; default all of the format")
    parser.add_argument("--seeds", type=_range, default=(0, 100), metavar="FIRST:LAST")
    parser.add_argument("--only", metavar="NAME", help="one mutant, such as 17 or 17/4")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the files of --only")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--guided", type=float, default=0.2, help="share that starts from a mutant")
    parser.add_argument("--seconds", type=float, help="stop after so many, with what is done")
    parser.add_argument("--out", type=Path, help=f"the record, such as {RESULTS.name}/mutants.json")
    parser.add_argument("--worker", type=int, nargs=2, help=argparse.SUPPRESS)
    return parser.parse_args(argv)


def _range(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    return int(first), int(last)


def chosen(options: argparse.Namespace) -> list[tuple[str, str]]:
    """Formats and commands that are asked for."""
    pairs = [(name, command) for name in options.format for command in FORMATS[name].commands]
    return [pair for pair in pairs if not options.command or pair[1] in options.command]


def started(options: argparse.Namespace, folder: Path, path: Path) -> list[subprocess.Popen[bytes]]:
    """One process for each job; a library in front of it reports the files that it opens."""
    library = preload.built(SOURCE, folder)
    words = ["--format", *options.format, "--seeds", "{}:{}".format(*options.seeds)]
    words += ["--guided", str(options.guided)]
    words += ["--command", *options.command] if options.command else []
    words += ["--seconds", str(options.seconds)] if options.seconds else []
    words += ["--only", options.only] if options.only else []
    words += ["--keep", str(options.keep.resolve())] if options.keep else []
    jobs = 1 if options.only else options.jobs
    return [
        preload.start(
            MODULE,
            [*words, "--worker", str(k), str(jobs)],
            library,
            path,
        )
        for k in range(jobs)
    ]


if __name__ == "__main__":
    sys.exit(main())
