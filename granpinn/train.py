"""The command `python -m granpinn.train FLOW.h5 --out DIR`: from a flow file to a report.

flow file -> noise -> training set -> identification -> results.json, fields.h5 -> checks -> report

Whatever follows the first results.json fails alone: it becomes a sentence in `not_done` of
results.json, in the terminal and on the page (granpinn/results/attempt.py).

`torchrun --nproc-per-node K -m granpinn.train ...` lets K processes share every batch. If the
machine has GPUs, each process uses its own one.

The work is in granpinn/command/training_run.py, which is loaded after the words of the command: so
`--help` and refusals are quick.

Exit codes: 0 done, also without a check of the default, a figure or the page; 2 bad input; 1 the
run could not go on, or it lacks fields or a check that a setting asks for; 129, 130, 143 stopped by
SIGHUP, SIGINT, SIGTERM.
"""

from __future__ import annotations

from granpinn.command import exit_codes

if __name__ == "__main__":
    exit_codes.guard_process("train")

import sys
import time
from collections.abc import Sequence

from granpinn.command.arguments import parse

BEGIN = time.monotonic()


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit code."""

    def run() -> int:
        begin = BEGIN if argv is None else time.monotonic()
        config, verbose = parse(sys.argv[1:] if argv is None else argv)
        from granpinn.command import training_run

        exit_codes.keep_what_is_loaded()
        return training_run.run(config, verbose, begin)

    return exit_codes.exit_code("train", run)


if __name__ == "__main__":
    sys.exit(main())
