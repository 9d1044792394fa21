"""A process that makes mutants and runs commands on them; prints one line of JSON for each."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from bench.studies.reliability import commands, damage, hdf5_edits, sandbox
from bench.studies.reliability.judge import ALLOWED, BAIT, described, fingerprint, judged
from bench.studies.reliability.samples import FORMATS, Files, Format

BLOCK = 25  # mutants of one target before the next target has its turn
DRAWN = 40  # one mutant of so many has its figures drawn, which takes most of the time
TRACED = 4  # one mutant of so many is traced for new places
PARENTS = 500  # mutants that are kept as parents
BEGIN = time.monotonic()
rows = sys.stdout


@dataclass
class Target:
    """A command on a format, with the run on its valid files."""

    name: str
    command: str
    format: Format
    files: Files
    bait: bytes
    valid: sandbox.Outcome
    draw: Random
    reached: set[int] = field(default_factory=set)
    parents: list[str] = field(default_factory=list)

    def run(self, mutant: str) -> int:
        """The command, in the working directory; one mutant of DRAWN has its figures drawn."""
        drawn = int(mutant.rpartition("/")[2] or 0) % DRAWN == 0
        with (
            warnings.catch_warnings(),
            contextlib.nullcontext() if drawn else commands.without_drawing(),
        ):
            return commands.MAINS[self.command.split("-")[0]](self.format.commands[self.command])


def work(pairs: list[tuple[str, str]], seeds: Sequence[int], options: argparse.Namespace) -> None:
    """Run the mutants of these seeds; all targets take turns, so that a time limit is fair."""
    global rows
    end = BEGIN + (options.seconds or float("inf"))
    rows = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what writers of valid files print
    commands.import_late_modules()
    targets = list(_targets(pairs))
    if options.only:
        for target in targets:
            _print(_row(target, options.only, False, options.keep))
        return
    for start in range(0, len(seeds), BLOCK):
        for target, seed in itertools.product(targets, seeds[start : start + BLOCK]):
            if time.monotonic() > end:
                return
            guided = bool(target.parents) and target.draw.random() < options.guided
            mutant = f"{target.draw.choice(target.parents)}/{seed}" if guided else str(seed)
            _print(_row(target, mutant, seed % TRACED == 0, None))


def _targets(pairs: list[tuple[str, str]]) -> Iterator[Target]:
    """Targets whose libraries are installed, with the run on their valid files."""
    written: dict[str, Files] = {}
    for name, command in pairs:
        chosen = FORMATS[name]
        if missing := chosen.missing():
            _print({"format": name, "command": command, "not run": missing})
            continue
        if name not in written:
            written[name] = chosen.files()
        draw = Random(f"{name} {command} guide")
        nothing = sandbox.Outcome(None, 0.0)
        target = Target(name, command, chosen, written[name], _bait(), nothing, draw)
        target.valid, outcome = _one(target, "", False)
        # What it opens and starts on this machine is the base for its mutants.
        if target.valid.code != 0 and outcome not in ALLOWED:
            numbers = described(target.valid, target.valid)
            kind = f"{outcome}: {fingerprint(target.valid)}"
            row = {"format": name, "command": command, "mutant": "", "outcome": "valid file failed"}
            _print(row | {"failed": True, "class": kind, "warnings": 0, **numbers})
            continue
        yield target


def _row(target: Target, mutant: str, trace: bool, keep: Path | None) -> dict[str, Any]:
    """Run one mutant; its row of the record."""
    found, outcome = _one(target, mutant, trace, keep)
    if found.places - target.reached and len(target.parents) < PARENTS and found.code is not None:
        target.reached |= found.places
        target.parents.append(mutant)
    row = {
        "format": target.name,
        "command": target.command,
        "mutant": mutant,
        "outcome": outcome,
        "failed": outcome not in ALLOWED,
        "warnings": found.errors.count("Warning: "),
        "watched": "LD_PRELOAD" in os.environ,
        "at": round(time.monotonic() - BEGIN),
        **described(found, target.valid),
    }
    if row["failed"]:
        row["class"] = fingerprint(found)
        row["repeat"] = f"--format {target.name} --command {target.command} --only {mutant}"
    else:
        del row["message"]
    return row


def _one(
    target: Target, mutant: str, trace: bool, keep: Path | None = None
) -> tuple[sandbox.Outcome, str]:
    """Run the command on a mutant; the empty name is the valid file."""
    with tempfile.TemporaryDirectory(prefix="mutant") as made:
        folder = Path(made).resolve() / "work"
        folder.mkdir()

        def prepare() -> None:
            files = mutated(target, mutant, folder)
            for name, content in files.items():
                path = folder / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
            (folder / BAIT).write_bytes(target.bait)

        found = sandbox.run(lambda: target.run(mutant), prepare, folder, trace=trace)
        outcome = judged(found, target.command, folder, target.valid if mutant else None)
        if keep is not None:
            shutil.copytree(folder, keep, dirs_exist_ok=True)
            print(found.errors, file=sys.stderr)
        return found, outcome


def mutated(target: Target, mutant: str, folder: Path) -> Files:
    """The files of a mutant: every seed of its name damages those of the seeds before."""
    files = dict(target.files)
    names = target.format.only or tuple(sorted(files))
    for seed in mutant.split("/") if mutant else ():
        # The same damage for all commands of a format, so that they can be compared.
        draw = Random(f"{target.name} {seed}")
        for name in damage.pick(names, draw):
            content, other = files[name], files[draw.choice(names)]
            if hdf5_edits.is_hdf5(content) and draw.random() < 0.6:
                try:
                    files[name] = hdf5_edits.edited(content, draw, folder)
                except OSError:  # damaged by the seeds before, so that it cannot be edited
                    files[name] = damage.damaged(content, draw, False, other)
            else:
                files[name] = damage.damaged(content, draw, target.format.text, other)
    return files


def _bait() -> bytes:
    """A valid flow file that no command is told to read."""
    return FORMATS["flow"].files()["flow.h5"]


def _print(row: dict[str, Any]) -> None:
    print(json.dumps(row), file=rows, flush=True)
