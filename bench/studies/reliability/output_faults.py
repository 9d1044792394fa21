"""A fault at every write of every output file, and a disk that is full at every 4 kB: F-5, T-3.

    python -m bench.studies.reliability.output_faults --case train convert --out faults.json

Each fault must end with exit code 1 and one sentence that names the file. What was there before
must be whole, no temporary file may stay, and the command once more, with --resume where it has
that, must leave the same bytes as a run without a fault.

campaign.py says where the rows are.
"""

from __future__ import annotations

import argparse
import errno
import itertools
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.studies.reliability import campaign, commands, sandbox
from bench.studies.reliability.campaign import Worker
from bench.studies.reliability.outputs import CASES, Case, damaged
from bench.studies.reliability.record import Record, command_of
from bench.studies.reliability.samples import Files, read_all, write_all

MODULE = "bench.studies.reliability.output_faults"
SOURCE = Path(__file__).with_name("faults.c")
MODES = {
    "no space": {"ERRNO": str(errno.ENOSPC)},
    "input/output error": {"ERRNO": str(errno.EIO)},
    "no space from here on": {"ERRNO": str(errno.ENOSPC), "STAYS": "1"},
}
STEP = 4096  # bytes
FINE = "one sentence, all whole"
HARMLESS = "harmless"  # the command does not need the call, and its files are right
LOCK = ".lock"
NAMED = re.compile(r" (\S*/)?[\w.-]+ could not be written ")
TEMPORARY = re.compile(r"^\.(.+)\.[0-9a-f]+\.tmp$")


@dataclass(frozen=True)
class Fault:
    """A fault: the call that fails, or the bytes that fit on the disk."""

    mode: str
    at: int

    def environment(self) -> dict[str, str]:
        """What faults.c reads."""
        if self.mode == "full disk":
            return {"BUDGET": str(self.at)}
        return MODES[self.mode] | {"AT": str(self.at)}


@dataclass(frozen=True)
class Target:
    """A case, the files before it, and what a run without a fault does."""

    name: str
    case: Case
    before: Files
    same: Files  # files that do not differ between two runs
    clean: sandbox.Outcome
    faults: list[Fault]


def work(worker: Worker, options: argparse.Namespace) -> None:
    """Try the faults of one worker; all cases take turns, so that a time limit is fair."""
    commands.import_late_modules()
    shares = []
    for name in options.case:
        target = _target(name)
        worker.row({"case": name, "faults": len(target.faults)})
        shares.append([(target, fault) for fault in target.faults[:: options.every][worker.share]])
    turns = itertools.chain.from_iterable(itertools.zip_longest(*shares))
    for target, fault in filter(None, turns):
        if worker.late:
            return
        row = {"case": target.name, "mode": fault.mode, "at": fault.at, **_tried(target, fault)}
        worker.row(row)


def _target(name: str) -> Target:
    """A case with its faults, from two runs without a fault."""
    case = CASES[name]
    before = case.files()
    if case.repeated:
        before = _run(case, case.arguments, before, None)[1]
    clean, after = _run(case, case.arguments, before, None)
    if clean.code != 0:
        raise RuntimeError(f"{name} without a fault: {clean.code}: {clean.errors}")
    again = _run(case, case.arguments, before, None)[1]
    kept = set(after) - set(case.timed)
    same = {path: after[path] for path in kept if again.get(path) == after[path]}
    return Target(name, case, before, same, clean, list(_faults(clean, after, before)))


def _faults(clean: sandbox.Outcome, after: Files, before: Files) -> Iterator[Fault]:
    for mode in MODES:
        yield from (Fault(mode, at + 1) for at in range(len(clean.calls)))
    size = sum(len(content) for path, content in after.items() if before.get(path) != content)
    yield from (Fault("full disk", at) for at in range(0, size, STEP))


def _run(
    case: Case, arguments: Sequence[str], files: Files, fault: Fault | None
) -> tuple[sandbox.Outcome, Files]:
    """Run a command in a folder with these files; its outcome and the files afterwards."""
    with tempfile.TemporaryDirectory(prefix="fault") as made:
        folder = Path(made).resolve() / "work"
        folder.mkdir()
        write_all(files, folder)

        def prepare() -> None:
            settings: dict[str, str] = {} if fault is None else fault.environment()
            for key, value in ({"FOLDER": str(folder), "LOG": str(sandbox.LOG)} | settings).items():
                os.environ[f"GRANPINN_FAULT_{key}"] = value

        def command() -> int:
            with commands.without_drawing():
                return commands.MAINS[case.command](arguments)

        found = sandbox.run(command, prepare, folder)
        return found, read_all(folder)


def _tried(target: Target, fault: Fault) -> dict[str, Any]:
    case, before = target.case, target.before
    found, after = _run(case, case.arguments, before, fault)
    call = target.clean.calls[fault.at - 1] if fault.mode != "full disk" else ("", "")
    outcome = _outcome(case, fault, found, before, after, target.same, call[1])
    row: dict[str, Any] = {"outcome": outcome, "failed": outcome not in (FINE, HARMLESS)}
    if row["failed"]:
        row |= {"call": " ".join((call[0], Path(call[1]).name)), "code": found.code}
        row["message"] = found.errors.strip()[-300:]
    return row


def _outcome(
    case: Case,
    fault: Fault,
    found: sandbox.Outcome,
    before: Files,
    after: Files,
    same: Files,
    target: str,
) -> str:
    if found.broken is not None:
        return found.broken
    with tempfile.TemporaryDirectory() as folder:
        for path, content in after.items():
            if path.endswith(".tmp"):
                return "temporary file left"
            if before.get(path) != content and damaged(path, content, Path(folder)):
                return "damaged file left"
    if any(path not in after for path in before):
        return "earlier file lost"
    if found.code == 0:
        wrong = [path for path in same if after.get(path) != same[path]]
        return "fault not noticed" if wrong else HARMLESS
    if found.code != 1:
        return f"exit code {found.code}"
    if problem := _sentence(found.errors, case, fault.mode, target):
        return problem
    again = _run(case, case.resume or case.arguments, after, None)
    if again[0].code != 0:
        return "cannot be continued"
    if any(again[1].get(path) != content for path, content in same.items()):
        return "other bytes after continuing"
    return FINE


def _sentence(errors: str, case: Case, mode: str, target: str) -> str:
    """What is wrong with the sentence; empty if nothing is."""
    lines = [line for line in errors.splitlines() if line.startswith(f"granpinn.{case.command}: ")]
    if len(lines) != 1:
        return "no single sentence"
    name = Path(target).name
    match = TEMPORARY.match(name)
    name = match[1] if match else name
    if name == LOCK:
        name = Path(target).parent.name  # the sentence is about the folder that is in use
    # A full disk may first be noticed at any file; "work" is the folder of the test itself.
    if mode in ("full disk", "no space from here on") or name == "work":
        return "" if NAMED.search(lines[0]) else "path not named"
    return "" if name in lines[0] else "path not named"


def gathered(rows: Iterable[dict[str, Any]]) -> Record:
    """The record of faults in outputs: for each case how many there are, and those tried."""
    record = Record("F-5, T-3")
    cases: dict[str, Counter[str]] = {}
    for row in rows:
        table = cases.setdefault(row["case"], Counter(faults=0, tried=0))
        if "faults" in row:
            table["faults"] = max(table["faults"], row["faults"])
            continue
        table["tried"] += 1
        table[row["outcome"]] += 1
        record.add(row["outcome"], row if row["failed"] else None)
    record.details = {"cases": {name: dict(table) for name, table in sorted(cases.items())}}
    return record


def main(argv: list[str] | None = None) -> int:
    """Run all faults and write the record; exit code 1 if one ended as it must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--case", nargs="*", default=list(CASES), choices=list(CASES))
    parser.add_argument("--every", type=int, default=1, help="only every so many faults")
    campaign.add_options(parser)
    options = parser.parse_args(argv)
    return campaign.run(work, gathered, SOURCE, options, command_of(MODULE, argv), needed=True)


if __name__ == "__main__":
    sys.exit(main())
