"""Where the seconds of `python -m granpinn.train` go, from the start of the process to its exit.

    python -m bench.command_profile --json bench/results/command_gpu.json -- --device cuda
    python -m bench.command_profile --module granpinn.tables --flow FLOW.h5 ... -- --seeds 5

Runs the command twice: once as a user does, which gives the times of the answer and of the exit,
and once with the sampler (sampler.py), which says where they go. The flow is the demonstration
unless `--flow` names others. The words after `--` go to the command.

Defends: what a user waits for is the training, not what stands before and after it.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from bench import sampler
from bench.studies import raw
from granpinn.simulation import demo_path

SHARE = 0.01  # of the sampled time: functions that take less are left out
EXIT = "exit of Python"
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


def phases(samples: dict[str, Any], begin: float, end: float) -> list[dict[str, Any]]:
    """The phases of the main thread in the order of their first appearance, with their seconds.

    Args:
        samples: of the sampler.
        begin, end: of the process, by the same clock.
    """
    whole = [
        (sampler.START, begin, samples["begin"]),
        *samples["timeline"],
        (EXIT, samples["end"], end),
    ]
    found: dict[str, dict[str, Any]] = {}
    for name, first, last in whole:
        empty = {"phase": name, "from_s": round(first - begin, 2), "seconds": 0.0}
        row = found.setdefault(name, empty)
        row["seconds"] += last - first
        row["to_s"] = round(last - begin, 2)
    return [row | {"seconds": round(row["seconds"], 2)} for row in found.values()]


def hot(samples: dict[str, Any]) -> list[dict[str, Any]]:
    """The functions that take long, callees included, by their time in all threads."""
    least = SHARE * (samples["end"] - samples["begin"])
    return [row for row in samples["rows"] if row["main_s"] + row["others_s"] >= least]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", type=Path, help="file for the results")
    parser.add_argument("--module", default="granpinn.train", help="the command")
    parser.add_argument("--flow", type=Path, nargs="+", default=[demo_path()], help="flow files")
    parser.add_argument("words", nargs="*", help="settings of the command, after --")
    own = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        command = [own.module, *map(str, own.flow), *own.words]
        plain = timed([sys.executable, "-u", "-m", *command, "--out", f"{folder}/plain"])
        path = Path(folder) / "samples.json"
        words = [sys.executable, "-u", "-m", "bench.sampler", str(path), *command]
        begin = time.monotonic()
        watched = timed([*words, "--out", f"{folder}/sampled"])
        end = time.monotonic()
        samples = json.loads(path.read_text())
    timeline, rows = phases(samples, begin, end), hot(samples)
    raw.write(
        own.json,
        {
            "module": own.module,
            "flow": [path.name for path in own.flow],
            "words": own.words,
            "seconds": plain,
            "sampled": watched,
            "timeline": timeline,
            "rows": rows,
        },
    )
    print(plain)
    for row in timeline:
        print(f"{row['seconds']:8.2f} {row['from_s']:8.2f} {row['to_s']:8.2f}  {row['phase']}")
    for row in rows[:60]:
        print(f"{row['main_s']:8.2f} {row['others_s']:8.2f}  {row['function']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
