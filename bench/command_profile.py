"""Seconds of `python -m granpinn.train` from the start of the process to its answer and its exit.

    python -m bench.command_profile --json command.json -- --device cuda

The command runs `--repeats` times as a user gives it; the medians come last. The flow is the
demonstration unless `--flow` names others. The words after `--` go to the command. For functions,
run it once more under a profiler: `python -m cProfile -o FILE -m granpinn.train ...`.

Defends: what a user waits for is the training, not what stands before and after it.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench.studies import raw
from granpinn.simulation import demo_path

ANSWER = "mu_s"  # the first word of the line that gives the answer


def timed(words: list[str]) -> dict[str, float]:
    """Seconds from the start of a command to its first output, its answer and its exit; its CPU's.

    Raises:
        SystemExit: the command failed.
    """
    begin, used = time.monotonic(), _of_children()
    found: dict[str, float] = {}
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            now = time.monotonic() - begin
            found.setdefault("first_line_s", now)
            if line.startswith(ANSWER):
                found.setdefault("answer_s", now)
    found["exit_s"] = time.monotonic() - begin
    found["cpu_s"] = _of_children() - used
    if process.returncode:
        raise SystemExit(f"{' '.join(words)} ended with {process.returncode}")
    return {name: round(value, 2) for name, value in found.items()}


def _of_children() -> float:
    """CPU seconds of all processes that this one has started and that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", type=Path, help="file for the results")
    parser.add_argument("--module", default="granpinn.train", help="the command")
    parser.add_argument("--flow", type=Path, nargs="+", default=[demo_path()], help="flow files")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("words", nargs="*", help="settings of the command, after --")
    own = parser.parse_args()
    command = [sys.executable, "-u", "-m", own.module, *map(str, own.flow), *own.words]
    runs = []
    for _ in range(own.repeats):
        with tempfile.TemporaryDirectory() as folder:
            runs.append(timed([*command, "--out", f"{folder}/run"]))
        print(runs[-1], flush=True)
    medians = {name: statistics.median(run[name] for run in runs) for name in runs[0]}
    flows = [path.name for path in own.flow]
    head = {"module": own.module, "flow": flows, "words": own.words}
    raw.write(own.json, head | {"runs": runs, "medians": medians})
    print(medians)
    return 0


if __name__ == "__main__":
    sys.exit(main())
