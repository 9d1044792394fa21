"""A gate that runs in several processes, behind a small C library that watches or fails calls.

Each of the N workers appends its rows, one line of JSON for each input, to one file, FILE.rows
beside --out FILE.json, so that nothing is lost if the run is killed.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from unittest import mock

from bench.studies.reliability.record import Record

SETTINGS = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg", "CUDA_VISIBLE_DEVICES": ""}


class Worker:
    """One of the processes: its rows, its share of the inputs, and the time that it has left.

    Other prints of the process, such as those of writers of valid files, are dropped.
    """

    def __init__(self, options: argparse.Namespace, number: int, path: Path) -> None:
        self._begin, self._seconds = time.monotonic(), options.seconds or float("inf")
        self.share = slice(number, None, options.jobs)
        self._rows = path.open("a", encoding="utf-8")
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    @property
    def late(self) -> bool:
        return time.monotonic() - self._begin > self._seconds

    def row(self, content: dict[str, Any]) -> None:
        """Write a row at once."""
        print(json.dumps(content), file=self._rows, flush=True)


Work = Callable[[Worker, argparse.Namespace], None]


def _work(work: Work, options: argparse.Namespace, number: int, path: Path) -> None:
    work(Worker(options, number, path), options)


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options that all campaigns have."""
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--seconds", type=float, help="stop after so many, with what is done")
    parser.add_argument("--out", type=Path, help="the record")


def run(
    work: Work,
    gathered: Callable[[Iterable[dict[str, Any]]], Record],
    source: Path,
    options: argparse.Namespace,
    command: str,
    needed: bool = False,
) -> int:
    """Start the workers, wait, and write the record; 1 if an input ended as it must not.

    Args:
        work: of one worker.
        gathered: the record of the rows of all workers.
        source: of the library, in C.
        command: repeats the run.
        needed: whether the workers cannot do without the library, where there is no compiler.
    """
    spawn = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as made:
        path = Path(made) / "rows" if options.out is None else options.out.with_suffix(".rows")
        path.write_text("")
        begin = time.monotonic()
        library = built(source, Path(made))
        if library is None and needed:
            print(f"{command} needs a C compiler: install cc", file=sys.stderr)
            return 2
        preload = {} if library is None else {"LD_PRELOAD": str(library)}
        with mock.patch.dict(os.environ, SETTINGS | preload):
            workers = [
                spawn.Process(target=_work, args=(work, options, number, path))
                for number in range(options.jobs)
            ]
            for worker in workers:
                worker.start()
        for worker in workers:
            worker.join()
        # A last line that was cut off is left out.
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        record = gathered(json.loads(line) for line in lines if line.endswith("}\n"))
    record.seconds, record.command = time.monotonic() - begin, command
    if ended := sum(worker.exitcode != 0 for worker in workers):
        print("a worker ended early: its inputs are missing", file=sys.stderr)
        record.details["workers that ended early"] = ended
    if options.out is not None:
        record.write(options.out)
    show(record)
    return int(bool(record.failures or ended))


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
