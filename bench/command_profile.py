"""Where the seconds of `python -m granpinn.train` go, from the start of the process to its exit.

    python -m bench.command_profile --json bench/results/command_gpu.json -- --device cuda

Runs the command twice: once as a user does, which gives the times of the answer and of the exit,
and once under the profiler, which says where they go. The flow is the demonstration unless `--flow`
names another. The words after `--` go to the command.

Defends: what a user waits for is the training, not what stands before and after it.
"""

from __future__ import annotations

import argparse
import pstats
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from bench.studies import raw
from granpinn.simulation import demo_path

SHARE = 0.01  # of the profiled time: what takes less is left out
PACKAGE = "granpinn"
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


def hot(stats: pstats.Stats) -> list[dict[str, Any]]:
    """Functions of the package by their time, callees included; and the time of imports."""
    every = stats.get_stats_profile()
    least = SHARE * every.total_tt
    rows = []
    for (file, line, name), (_, calls, own, total, _) in stats.stats.items():  # type: ignore[attr-defined]
        parts = Path(file).parts
        importing = name in {"<built-in method builtins.__import__>", "_find_and_load"}
        if total < least or not (PACKAGE in parts or importing):
            continue
        where = "/".join(parts[len(parts) - parts[::-1].index(PACKAGE) :]) if not importing else ""
        rows.append(
            {
                "function": f"{where}:{line} {name}" if where else name,
                "calls": calls,
                "own_s": round(own, 3),
                "total_s": round(total, 3),
            }
        )
    return sorted(rows, key=lambda row: -row["total_s"])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", type=Path, help="file for the results")
    parser.add_argument("--flow", type=Path, default=demo_path(), help="a flow file")
    parser.add_argument("words", nargs="*", help="settings of the command, after --")
    own = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        command = ["-m", "granpinn.train", str(own.flow), *own.words]
        profile = f"{folder}/profile"
        plain = timed([sys.executable, "-u", *command, "--out", f"{folder}/plain"])
        run = [sys.executable, "-u", "-m", "cProfile", "-o", profile, *command]
        profiled = timed([*run, "--out", f"{folder}/profiled"])
        rows = hot(pstats.Stats(profile))
    raw.write(
        own.json,
        {
            "flow": own.flow.name,
            "words": own.words,
            "seconds": plain,
            "profiled": profiled,
            "rows": rows,
        },
    )
    print(plain)
    for row in rows[:60]:
        print(f"{row['total_s']:8.2f} {row['own_s']:8.2f} {row['calls']:8} {row['function']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
