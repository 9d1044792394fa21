"""A fault at every write of every output file, and a disk that is full at every 4 kB: F-5, T-3.

    python -m bench.studies.reliability.output_faults --case train convert --out faults.json

Each fault must end with exit code 1 and one sentence that names the file. What was there before
must be whole, no temporary file may stay, and the command once more, with --resume where it has
that, must leave the same bytes as a run without a fault.

Rows are written while it runs, to FILE.rows beside --out FILE.json. They are not lost if the run
is killed, and rows.py makes one record of them.
"""

from __future__ import annotations

import argparse
import errno
import sys
import tempfile
from pathlib import Path

from bench.studies.reliability import preload, rows
from bench.studies.reliability.outputs import CASES
from bench.studies.reliability.record import command_of

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
    with tempfile.TemporaryDirectory() as made:
        library = preload.built(SOURCE, Path(made))
        if library is None:
            print("output_faults: needs a C compiler, cc", file=sys.stderr)
            return 2
        path = Path(made) / "rows" if options.out is None else options.out.with_suffix(".rows")
        rows.begin(path, command_of(MODULE, argv), GATE)
        words = ["--every", str(options.every), "--case", *options.case]
        words += ["--seconds", str(options.seconds)] if options.seconds else []
        workers = [
            preload.start(MODULE, [*words, "--worker", str(k), str(options.jobs)], library, path)
            for k in range(options.jobs)
        ]
        ended = [worker.wait() for worker in workers]
        whole = rows.merged([path])
    if any(ended):
        print("a worker ended early: its faults are missing", file=sys.stderr)
        whole["details"]["workers that ended early"] = sum(map(bool, ended))
    if options.out is not None:
        rows.write(options.out, whole)
    rows.show(whole)
    return int(bool(whole["failed"]) or any(ended))


def parse(argv: list[str]) -> argparse.Namespace:
    """The options of a command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--case", nargs="*", default=list(CASES), choices=list(CASES))
    parser.add_argument("--every", type=int, default=1, help="only every so many faults")
    parser.add_argument("--jobs", type=int, default=1, help="processes that share the faults")
    parser.add_argument("--seconds", type=float, help="stop after so many, with what is done")
    parser.add_argument("--out", type=Path, help="the record")
    parser.add_argument("--worker", type=int, nargs=2, help=argparse.SUPPRESS)
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
