"""Runs commands on damaged files: gates F-1, F-2 and F-4.

    python -m bench.studies.reliability.mutants --format flow --command train --seeds 0:99 --jobs 2
    python -m bench.studies.reliability.mutants --format flow --seeds 17:18 --keep out

A mutant is a function of its format and its seed. campaign.py says where the rows are.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import os
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from bench.studies.reliability import campaign, commands, damage, hdf5_edits, sandbox
from bench.studies.reliability.campaign import Worker
from bench.studies.reliability.judge import ALLOWED, BAIT, READER, described, fingerprint, judged
from bench.studies.reliability.record import Record, command_of
from bench.studies.reliability.samples import FORMATS, Files, Format, write_all

MODULE = "bench.studies.reliability.mutants"
SOURCE = Path(__file__).with_name("opens.c")
BLOCK = 25  # mutants of one target before the next target has its turn
DRAWN = 40  # one mutant of so many has its figures drawn, which takes most of the time


@dataclass
class Target:
    """A command on a format, with the run on its valid files."""

    name: str
    command: str
    format: Format
    files: Files
    bait: bytes
    valid: sandbox.Outcome

    def run(self, seed: int) -> int:
        """The command, in the working directory; one mutant of DRAWN has its figures drawn."""
        drawn = seed % DRAWN == 0
        commands.take_reader()
        with (
            warnings.catch_warnings(),
            contextlib.nullcontext() if drawn else commands.without_drawing(),
        ):
            return commands.MAINS[self.command.split("-")[0]](self.format.commands[self.command])


def work(worker: Worker, options: argparse.Namespace) -> None:
    """Run the mutants of a worker; all targets take turns, so that a time limit is fair."""
    commands.import_late_modules()
    pairs = [(name, command) for name in options.format for command in FORMATS[name].commands]
    asked = options.command
    targets = list(_targets([p for p in pairs if not asked or p[1] in asked], worker))
    seeds = range(*options.seeds)[worker.share]
    for start in range(0, len(seeds), BLOCK):
        for target, seed in itertools.product(targets, seeds[start : start + BLOCK]):
            if worker.late:
                return
            worker.row(_row(target, seed, options.keep))


def _targets(pairs: list[tuple[str, str]], worker: Worker) -> Iterator[Target]:
    """Targets whose libraries are installed, with the run on their valid files."""
    written: dict[str, Files] = {}
    for name, command in pairs:
        chosen = FORMATS[name]
        if missing := chosen.missing():
            worker.row({"format": name, "command": command, "not run": missing})
            continue
        if name not in written:
            written[name] = chosen.files()
        nothing = sandbox.Outcome(None, 0.0)
        target = Target(name, command, chosen, written[name], _bait(), nothing)
        target.valid, outcome = _one(target, None)
        # What it opens and starts on this machine is the base for its mutants.
        if target.valid.code != 0:
            numbers = described(target.valid, target.valid)
            kind = f"{outcome}: {fingerprint(target.valid)}"
            row = {"format": name, "command": command, "mutant": "", "outcome": "valid file failed"}
            worker.row(row | {"failed": True, "class": kind, "warnings": 0, **numbers})
            continue
        yield target


def _row(target: Target, seed: int, keep: Path | None) -> dict[str, Any]:
    """Run one mutant; its row of the record."""
    found, outcome = _one(target, seed, keep)
    row = {
        "format": target.name,
        "command": target.command,
        "mutant": str(seed),
        "outcome": outcome,
        "failed": outcome not in ALLOWED,
        "warnings": found.errors.count("Warning: "),
        "watched": "LD_PRELOAD" in os.environ,
        **described(found, target.valid),
    }
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
            write_all(target.files if seed is None else mutated(target, seed, folder), folder)
            (folder / BAIT).write_bytes(target.bait)

        commands.start_reader()
        found = sandbox.run(lambda: target.run(seed or 0), prepare, folder)
        outcome = judged(found, target.command, folder, None if seed is None else target.valid)
        if outcome not in ALLOWED or any(READER in line for line in found.started):
            commands.end_reader()  # it crashed, or is still at the request of this mutant
        if keep is not None:
            shutil.copytree(folder, keep, dirs_exist_ok=True)
            print(found.errors, file=sys.stderr)
        return found, outcome


def mutated(target: Target, seed: int, folder: Path) -> Files:
    """The files of a mutant, the same for all commands of a format."""
    files = dict(target.files)
    names = target.format.only or tuple(sorted(files))
    draw = Random(f"{target.name} {seed}")
    for name in damage.pick(names, draw):
        content, other = files[name], files[draw.choice(names)]
        if hdf5_edits.is_hdf5(content) and draw.random() < 0.6:
            files[name] = hdf5_edits.edited(content, draw, folder)
        else:
            files[name] = damage.damaged(content, draw, target.format.text, other)
    return files


def gathered(rows: Iterable[dict[str, Any]]) -> Record:
    """The record of mutants."""
    record = Record("F-1, F-2, F-4")
    tables: dict[str, Counter[str]] = {}
    worst: dict[str, dict[str, float]] = {}
    classes: Counter[str] = Counter()
    missing: dict[str, Any] = {}
    warnings, watched = 0, False
    for row in rows:
        pair = f"{row['format']} {row['command']}"
        if "not run" in row:
            missing[pair] = row["not run"]
            continue
        tables.setdefault(pair, Counter())[row["outcome"]] += 1
        worst.setdefault(pair, {"seconds": 0, "memory_ratio": 0})
        for name in worst[pair]:
            worst[pair][name] = max(worst[pair][name], row[name])
        if row["failed"]:
            classes[f"{pair}: {row['outcome']}: {row['class']}"] += 1
        warnings += row["warnings"]
        watched |= row.get("watched", False)
        record.add(row["outcome"], row if row["failed"] else None)
    record.details = {
        "formats": {pair: dict(table) | worst[pair] for pair, table in tables.items()},
        "classes": dict(classes.most_common()),
        "warnings": warnings,
        "files opened by libraries": "watched" if watched else "not",
    }
    if missing:
        record.details["not run"] = missing
    return record


def _bait() -> bytes:
    """A valid flow file that no command is told to read."""
    return FORMATS["flow"].files()["flow.h5"]


def main(argv: list[str] | None = None) -> int:
    """Run the mutants, write the record; exit code 1 if one of them ended as it must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--format", nargs="*", default=list(FORMATS), choices=list(FORMATS))
    parser.add_argument("--command", nargs="*", help="such as train; default all of the format")
    parser.add_argument("--seeds", type=_range, default=(0, 100), metavar="FIRST:LAST")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep their files")
    campaign.add_options(parser)
    options = parser.parse_args(argv)
    return campaign.run(work, gathered, SOURCE, options, command_of(MODULE, argv))


def _range(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    return int(first), int(last)


if __name__ == "__main__":
    sys.exit(main())
