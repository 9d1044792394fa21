"""A gate that runs in several processes, behind a small C library that watches or fails calls.

The module of a gate starts itself again with --worker K N for each of its N jobs. What a worker
prints, one line of JSON for each input, goes to the end of one file, FILE.rows beside --out
FILE.json, so that nothing is lost if the run is killed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from bench.studies.reliability.record import Record, command_of

SETTINGS = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg", "CUDA_VISIBLE_DEVICES": ""}


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options that all campaigns have."""
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--seconds", type=float, help="stop after so many, with what is done")
    parser.add_argument("--out", type=Path, help="the record")
    parser.add_argument("--worker", type=int, nargs=2, help=argparse.SUPPRESS)


def run(
    module: str,
    gathered: Callable[[Iterable[dict[str, Any]]], Record],
    source: Path,
    words: Sequence[str],
    argv: Sequence[str] | None,
    options: argparse.Namespace,
    needed: bool = False,
) -> int:
    """Start the workers, wait, and write the record; 1 if an input ended as it must not.

    Args:
        gathered: the record of the rows of all workers.
        source: of the library, in C.
        needed: whether the workers cannot do without it, where there is no compiler.
        words: of the command line of a worker.
        argv: of this command, for the record.
    """
    with tempfile.TemporaryDirectory() as made:
        path = Path(made) / "rows" if options.out is None else options.out.with_suffix(".rows")
        path.write_text("")
        begin = time.monotonic()
        library = built(source, Path(made))
        if library is None and needed:
            print(f"{module} needs a C compiler: install cc", file=sys.stderr)
            return 2
        own = [*words, *(["--seconds", str(options.seconds)] if options.seconds else [])]
        ended = [
            worker.wait()
            for worker in [
                _start([module, *own, "--worker", str(k), str(options.jobs)], library, path)
                for k in range(options.jobs)
            ]
        ]
        # A last line that was cut off is left out.
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        record = gathered(json.loads(line) for line in lines if line.endswith("}\n"))
    record.seconds, record.command = time.monotonic() - begin, command_of(module, argv)
    if any(ended):
        print("a worker ended early: its inputs are missing", file=sys.stderr)
        record.details["workers that ended early"] = sum(map(bool, ended))
    if options.out is not None:
        record.write(options.out)
    show(record)
    return int(bool(record.failures) or any(ended))


def show(record: Record) -> None:
    """Print the outcomes of each format or case, and the kinds of failures."""
    details = record.details
    for name, row in (details.get("formats") or details.get("cases", {})).items():
        print(f"{name:<24}" + ", ".join(f"{key} {value:.5g}" for key, value in row.items()))
    for name, count in details.get("classes", {}).items():
        print(f"{count:6} {name}")
    for pair, names in details.get("not run", {}).items():
        print(f"{pair}: not run, needs {names}")
    print(f"{record.tried} tried, {len(record.failures)} failures, {record.seconds:.0f} s")


def built(source: Path, folder: Path) -> Path | None:
    """The library of a C file, in `folder`; None without a compiler."""
    library = folder / f"{source.stem}.so"
    command = ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"]
    try:
        done = subprocess.run(command, check=False)
    except FileNotFoundError:
        return None
    return library if done.returncode == 0 else None


def _start(words: Sequence[str], library: Path | None, path: Path) -> subprocess.Popen[bytes]:
    environment = os.environ | SETTINGS
    if library is not None:
        environment["LD_PRELOAD"] = str(library)
    with path.open("a") as stream:
        return subprocess.Popen([sys.executable, "-m", *words], env=environment, stdout=stream)


class Worker:
    """The rows of one worker, and the time that it has left.

    Other prints of the process, such as those of writers of valid files, are dropped.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self._begin, self._seconds = time.monotonic(), options.seconds or float("inf")
        self._rows = os.fdopen(os.dup(1), "w")
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    @property
    def late(self) -> bool:
        return time.monotonic() - self._begin > self._seconds

    def row(self, content: dict[str, Any]) -> None:
        """Write a row at once."""
        print(json.dumps(content), file=self._rows, flush=True)
