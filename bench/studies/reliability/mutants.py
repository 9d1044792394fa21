"""Runs commands on damaged files: gates F-1, F-2 and F-4.

    python -m bench.studies.reliability.mutants --format flow --command train --seeds 0:99 --jobs 2
    python -m bench.studies.reliability.mutants --format flow --command train --only 17 --keep out

A mutant is a function of its format and its seed. campaign.py says where the rows are.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from bench.studies.reliability import campaign
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
    words = ["--format", *options.format, "--seeds", "{}:{}".format(*options.seeds)]
    words += ["--command", *options.command] if options.command else []
    words += ["--keep", str(options.keep.resolve())] if options.keep else []
    return campaign.run(MODULE, "F-2", SOURCE, words, argv, options)


def parse(argv: list[str]) -> argparse.Namespace:
    """The options of a command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--format", nargs="*", default=list(FORMATS), choices=list(FORMATS))
    parser.add_argument("--command", nargs="*", help="such as train; default all of the format")
    parser.add_argument("--seeds", type=_range, default=(0, 100), metavar="FIRST:LAST")
    parser.add_argument("--only", type=_one, dest="seeds", metavar="SEED", help="one mutant")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep their files")
    campaign.add_options(parser)
    return parser.parse_args(argv)


def _range(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    return int(first), int(last)


def _one(text: str) -> tuple[int, int]:
    return int(text), int(text) + 1


def chosen(options: argparse.Namespace) -> list[tuple[str, str]]:
    """Formats and commands that are asked for."""
    pairs = [(name, command) for name in options.format for command in FORMATS[name].commands]
    return [pair for pair in pairs if not options.command or pair[1] in options.command]


if __name__ == "__main__":
    sys.exit(main())
