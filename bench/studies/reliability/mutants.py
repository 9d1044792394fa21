"""Runs commands on damaged files: gates F-1, F-2 and F-4.

    python -m bench.studies.reliability.mutants --format flow --command train --seeds 0:99 --jobs 2
    python -m bench.studies.reliability.mutants --format flow --seeds 17:18 --keep out

A mutant is a function of its format and its seed. Each of the N workers appends its rows, one line
of JSON for each mutant, to one file, FILE.rows beside --out FILE.json, so that nothing is lost if
the run is killed. A small C library, opens.c, watches what the libraries open.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import importlib
import itertools
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

from bench.studies.reliability import damage, hdf5_edits, sandbox
from bench.studies.reliability.judge import ALLOWED, BAIT, READER, described, fingerprint, judged
from bench.studies.reliability.record import Record, command_of
from bench.studies.reliability.samples import FORMATS, Files, Sample, write_all
from granpinn.foreign import process

MODULE = "bench.studies.reliability.mutants"
SOURCE = Path(__file__).with_name("opens.c")
SETTINGS = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg", "CUDA_VISIBLE_DEVICES": ""}
LATE = ("h5netcdf", "xarray", "zarr", "pyvista", "pandas", "tables", "PIL.Image")
BLOCK = 25  # mutants of one target before the next target has its turn
DRAWN = 40  # one mutant of so many has its figures drawn, which takes most of the time
EMPTY_IMAGE = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNkYAAAAAYAAjCB0C8AAAAASUVORK5CYII="
)


@contextlib.contextmanager
def without_drawing() -> Iterator[None]:
    """Figures are composed, but an empty image is saved."""

    def save(canvas: Any, file: Any, **_: Any) -> None:
        file.write(EMPTY_IMAGE)

    with mock.patch("matplotlib.backends.backend_agg.FigureCanvasAgg.print_png", save):
        yield


@dataclass
class Target:
    """A command on a format, with the run on its valid files."""

    name: str
    command: str
    sample: Sample
    bait: bytes
    valid: sandbox.Outcome

    def run(self, seed: int) -> int:
        """The command, in the working directory; one mutant of DRAWN has its figures drawn."""
        process._running[0].owner = os.getpid()  # the others wait while this fork uses it
        main = importlib.import_module(f"granpinn.commands.{self.command.split('-')[0]}").main
        drawing = without_drawing() if seed % DRAWN else contextlib.nullcontext()
        with warnings.catch_warnings(), drawing:
            return int(main(self.sample.commands[self.command]))


def work(options: argparse.Namespace, number: int, path: Path) -> None:
    """Run the mutants of a worker; all targets take turns, so that a time limit is fair."""
    begin, limit = time.monotonic(), options.seconds or float("inf")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what the writers of valid files print
    for name in LATE:  # what commands import when they need it: once, before all forks
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    seeds = range(*options.seeds)[number :: options.jobs]
    with path.open("a", encoding="utf-8") as rows:

        def write(row: dict[str, Any]) -> None:
            print(json.dumps(row), file=rows, flush=True)

        targets = []
        for target in _targets(options.format, options.command):
            # What it opens and starts on this machine is the base for its mutants.
            target.valid, outcome = _one(target, None)
            if target.valid.code == 0:
                targets.append(target)
                continue
            row = _described(target, target.valid, "", "valid file failed")
            write(row | {"class": f"{outcome}: {fingerprint(target.valid)}"})
        for start in range(0, len(seeds), BLOCK):
            for target, seed in itertools.product(targets, seeds[start : start + BLOCK]):
                if time.monotonic() - begin > limit:
                    return
                write(_row(target, seed, options.keep))


def _targets(formats: list[str], asked: list[str] | None) -> Iterator[Target]:
    """The commands that are asked for (None: all) on these formats."""
    bait = FORMATS["flow"]().files["in/flow.h5"]  # which no command is told to read
    for name in formats:
        sample = FORMATS[name]()
        for command in sample.commands:
            if not asked or command in asked:
                yield Target(name, command, sample, bait, sandbox.Outcome(None, 0.0))


def _described(target: Target, found: sandbox.Outcome, mutant: str, outcome: str) -> dict[str, Any]:
    return {
        "format": target.name,
        "command": target.command,
        "mutant": mutant,
        "outcome": outcome,
        "failed": outcome not in ALLOWED,
        "warnings": found.errors.count("Warning: "),
        "watched": "LD_PRELOAD" in os.environ,
        **described(found, target.valid),
    }


def _row(target: Target, seed: int, keep: Path | None) -> dict[str, Any]:
    """Run one mutant; its row of the record."""
    found, outcome = _one(target, seed, keep)
    row = _described(target, found, str(seed), outcome)
    if row["failed"]:
        row["class"] = fingerprint(found)
        words = f"--format {target.name} --command {target.command}"
        row["repeat"] = f"{words} --seeds {seed}:{seed + 1}"
    else:
        del row["message"]
    return row


def _one(target: Target, seed: int | None, keep: Path | None = None) -> tuple[sandbox.Outcome, str]:
    """Run the command on a mutant; None: on the valid file."""
    with tempfile.TemporaryDirectory(prefix="mutant") as made:
        folder = Path(made).resolve() / "work"
        folder.mkdir()

        def prepare() -> None:
            files = target.sample.files if seed is None else mutated(target, seed, folder)
            write_all(files, folder)
            (folder / BAIT).write_bytes(target.bait)

        # The process that opens files starts here: its imports take longer than a mutant.
        if not process._running or process._running[0].process.poll() is not None:
            process._running[:] = [process._Process()]
        found = sandbox.run(lambda: target.run(seed or 0), prepare, folder)
        outcome = judged(found, target.command, folder, None if seed is None else target.valid)
        if outcome not in ALLOWED or any(READER in line for line in found.started):
            process._close()  # it crashed, or is still at the request of this mutant
        if keep is not None:
            shutil.copytree(folder, keep, dirs_exist_ok=True)
            print(found.errors, file=sys.stderr)
        return found, outcome


def mutated(target: Target, seed: int, folder: Path) -> Files:
    """The files of a mutant, the same for all commands of a format."""
    files, names = dict(target.sample.files), target.sample.damaged
    draw = Random(f"{target.name} {seed}")
    for name in draw.sample(names, min(len(names), draw.choice((1, 1, 1, 2)))):
        content, other = files[name], files[draw.choice(names)]
        if hdf5_edits.is_hdf5(content) and draw.random() < 0.6:
            files[name] = hdf5_edits.edited(content, draw, folder)
        else:
            files[name] = damage.damaged(content, draw, other)
    return files


def gathered(rows: Iterable[dict[str, Any]]) -> Record:
    """The record of mutants."""
    record = Record("F-1, F-2, F-4")
    tables: dict[str, Counter[str]] = {}
    worst: dict[str, dict[str, float]] = {}
    classes: Counter[str] = Counter()
    warned, watched = 0, False
    for row in rows:
        pair = f"{row['format']} {row['command']}"
        tables.setdefault(pair, Counter())[row["outcome"]] += 1
        worst.setdefault(pair, {"seconds": 0, "memory_ratio": 0})
        for name in worst[pair]:
            worst[pair][name] = max(worst[pair][name], row[name])
        if row["failed"]:
            classes[f"{pair}: {row['outcome']}: {row['class']}"] += 1
        warned += row["warnings"]
        watched |= row["watched"]
        record.add(row["outcome"], row if row["failed"] else None)
    record.details = {
        "formats": {pair: dict(table) | worst[pair] for pair, table in tables.items()},
        "classes": dict(classes.most_common()),
        "warnings": warned,
        "files opened by libraries": "watched" if watched else "not",
    }
    return record


def watching(folder: Path) -> dict[str, str]:
    """The environment that watches the libraries; nothing without a compiler."""
    library = folder / "opens.so"
    command = ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(SOURCE), "-ldl"]
    try:
        subprocess.run(command, check=True)
    except (FileNotFoundError, subprocess.CalledProcessError):
        return {}
    return {"LD_PRELOAD": str(library)}


def _range(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    return int(first), int(last)


def main(argv: list[str] | None = None) -> int:
    """Run the mutants, write the record; exit code 1 if one of them ended as it must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--format", nargs="*", default=list(FORMATS), choices=list(FORMATS))
    parser.add_argument("--command", nargs="*", help="such as train; default all of the format")
    parser.add_argument("--seeds", type=_range, default=(0, 100), metavar="FIRST:LAST")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep their files")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--seconds", type=float, help="stop after so many, with what is done")
    parser.add_argument("--out", type=Path, required=True, help="the record")
    options = parser.parse_args(argv)
    path, begin = options.out.with_suffix(".rows"), time.monotonic()
    path.write_text("")
    spawn = multiprocessing.get_context("spawn")
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.dict(os.environ, SETTINGS | watching(Path(folder))),
    ):
        numbers = range(options.jobs)
        workers = [spawn.Process(target=work, args=(options, number, path)) for number in numbers]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    # A last line that was cut off is left out.
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    record = gathered(json.loads(line) for line in lines if line.endswith("}\n"))
    record.seconds, record.command = time.monotonic() - begin, command_of(MODULE, argv)
    if ended := sum(worker.exitcode != 0 for worker in workers):
        print("a worker ended early: its mutants are missing", file=sys.stderr)
        record.details["workers that ended early"] = ended
    record.write(options.out)
    print(json.dumps(record.details, indent=1))
    print(f"{record.tried} tried, {len(record.failures)} failures, {record.seconds:.0f} s")
    return int(bool(record.failures or ended))


if __name__ == "__main__":
    sys.exit(main())
