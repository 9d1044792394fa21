"""A fault at every write of every output file, and a disk that is full at every 4 kB: F-5, T-3.

    python -m bench.studies.reliability.output_faults --case train convert --out faults.json

Each fault must end with exit code 1 and one sentence that names the file. What was there before
must be whole, no temporary file may stay, and the command once more, with --resume where it has
that, must leave the same bytes as a run without a fault.

campaign.py says where the rows are.
"""

from __future__ import annotations

import argparse
import errno
import sys
from pathlib import Path

from bench.studies.reliability import campaign
from bench.studies.reliability.outputs import CASES

MODULE = "bench.studies.reliability.output_faults"
GATE = "F-5, T-3"
SOURCE = Path(__file__).with_name("faults.c")
MODES = {
    "no space": {"ERRNO": str(errno.ENOSPC)},
    "input/output error": {"ERRNO": str(errno.EIO)},
    "no space from here on": {"ERRNO": str(errno.ENOSPC), "STAYS": "1"},
}
STEP = 4096  # bytes


def main(argv: list[str] | None = None) -> int:
    """Run all faults and write the record; exit code 1 if one ended as it must not."""
    options = parse(sys.argv[1:] if argv is None else argv)
    if options.worker is not None:
        from bench.studies.reliability.fault_worker import work

        work(options)
        return 0
    words = ["--every", str(options.every), "--case", *options.case]
    return campaign.run(MODULE, GATE, SOURCE, words, argv, options, needed=True)


def parse(argv: list[str]) -> argparse.Namespace:
    """The options of a command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--case", nargs="*", default=list(CASES), choices=list(CASES))
    parser.add_argument("--every", type=int, default=1, help="only every so many faults")
    campaign.add_options(parser)
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
