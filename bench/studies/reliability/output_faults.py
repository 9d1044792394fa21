"""A fault at every write of every output file, and a disk that is full at every 4 kB: F-5, T-3.

    python -m bench.studies.reliability.output_faults --case train convert --out faults.json

Each fault must end with exit code 1 and one sentence that names the file. What was there before
must be whole, no temporary file may stay, and the command once more, with --resume where it has
that, must leave the same bytes as a run without a fault.
"""

from __future__ import annotations

import argparse
import errno
import json
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from bench.studies.reliability import preload
from bench.studies.reliability.outputs import CASES
from bench.studies.reliability.record import Record, command_of

MODULE = "bench.studies.reliability.output_faults"
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
    if options.worker:
        from bench.studies.reliability.fault_worker import work

        work(options.case, options.every)
        return 0
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        library = preload.built(SOURCE, folder)
        if library is None:
            print("output_faults: needs a C compiler, cc", file=sys.stderr)
            return 2
        words = ["--worker", "--every", str(options.every), "--case", *options.case]
        ended = preload.start(MODULE, words, library, folder / "rows").wait()
        found = [json.loads(line) for line in (folder / "rows").read_text().splitlines()]
    record = Record("F-5, T-3", command=command_of(MODULE, argv))
    tables: dict[str, Counter[str]] = {}
    for row in found:
        tables.setdefault(row["case"], Counter())[row["outcome"]] += 1
        record.add(row["outcome"], row if row["failed"] else None)
    record.details = {"cases": {name: dict(table) for name, table in tables.items()}}
    record.seconds = time.monotonic() - begin
    if options.out is not None:
        record.write(options.out)
    for name, table in tables.items():
        print(f"{name:<22}" + ", ".join(f"{key} {count}" for key, count in table.most_common()))
    print(f"{record.tried} faults, {len(record.failures)} failures, {record.seconds:.0f} s")
    return int(bool(record.failures) or ended != 0)


def parse(argv: list[str]) -> argparse.Namespace:
    """The options of a command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--case", nargs="*", default=list(CASES), choices=list(CASES))
    parser.add_argument("--every", type=int, default=1, help="only every so many faults")
    parser.add_argument("--out", type=Path, help="the record")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
