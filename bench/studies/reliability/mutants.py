"""Runs commands on damaged files: gates F-1, F-2 and F-4.

    python -m bench.studies.reliability.mutants --format flow --command train --seeds 0:99 --jobs 2
    python -m bench.studies.reliability.mutants --format flow --command train --only 17 --keep out

A mutant is a function of format, command and its name. The name is a seed, or several: "17/4" is
mutant 4 of mutant 17, which was kept because it reached new places in the readers.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from bench.studies.reliability import preload
from bench.studies.reliability.record import RESULTS, Record, command_of
from bench.studies.reliability.samples import FORMATS

MODULE = "bench.studies.reliability.mutants"
SOURCE = Path(__file__).with_name("opens.c")


def main(argv: list[str] | None = None) -> int:
    """Run the mutants, write the record; exit code 1 if one of them ended as it must not."""
    options = parse(sys.argv[1:] if argv is None else argv)
    if options.worker is not None:
        from bench.studies.reliability.worker import work

        first, step = options.worker
        work(chosen(options), range(*options.seeds)[first::step], options)
        return 0
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        workers = started(options, Path(folder))
        ended = [worker.wait() for worker in workers]
        lines = [
            line for path in Path(folder).glob("*.rows") for line in path.read_text().splitlines()
        ]
    rows = [json.loads(line) for line in lines]
    record = gathered(rows, options)
    record.seconds = time.monotonic() - begin
    record.command = command_of(MODULE, argv)
    if any(ended):
        print("a worker ended early: its mutants are missing", file=sys.stderr)
        record.details["workers that ended early"] = sum(map(bool, ended))
    if options.out is not None:
        record.write(options.out)
    show(record)
    return int(bool(record.failures) or any(ended))


def parse(argv: list[str]) -> argparse.Namespace:
    """The options of a command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--format", nargs="*", default=list(FORMATS), choices=list(FORMATS))
    parser.add_argument("--command", nargs="*", help="such as train; default all of the format")
    parser.add_argument("--seeds", type=_range, default=(0, 100), metavar="FIRST:LAST")
    parser.add_argument("--only", metavar="NAME", help="one mutant, such as 17 or 17/4")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the files of --only")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--guided", type=float, default=0.2, help="share that starts from a mutant")
    parser.add_argument("--out", type=Path, help=f"the record, such as {RESULTS.name}/mutants.json")
    parser.add_argument("--worker", type=int, nargs=2, help=argparse.SUPPRESS)
    return parser.parse_args(argv)


def _range(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    return int(first), int(last)


def chosen(options: argparse.Namespace) -> list[tuple[str, str]]:
    """Formats and commands that are asked for."""
    pairs = [(name, command) for name in options.format for command in FORMATS[name].commands]
    return [pair for pair in pairs if not options.command or pair[1] in options.command]


def started(options: argparse.Namespace, folder: Path) -> list[subprocess.Popen[bytes]]:
    """One process for each job; a library in front of it reports the files that it opens."""
    library = preload.built(SOURCE, folder)
    words = ["--format", *options.format, "--seeds", "{}:{}".format(*options.seeds)]
    words += ["--guided", str(options.guided)]
    words += ["--command", *options.command] if options.command else []
    words += ["--only", options.only] if options.only else []
    words += ["--keep", str(options.keep.resolve())] if options.keep else []
    jobs = 1 if options.only else options.jobs
    return [
        preload.start(
            MODULE,
            [*words, "--worker", str(k), str(jobs)],
            library,
            folder / f"{k}.rows",
        )
        for k in range(jobs)
    ]


def gathered(rows: list[dict[str, Any]], options: argparse.Namespace) -> Record:
    """The record of all workers."""
    record = Record("F-1, F-2, F-4")
    tables: dict[str, Counter[str]] = {}
    worst: dict[str, dict[str, float]] = {}
    classes: Counter[str] = Counter()
    for row in rows:
        pair = f"{row['format']} {row['command']}"
        if "not run" in row:
            record.details.setdefault("not run", {})[pair] = row["not run"]
            continue
        tables.setdefault(pair, Counter())[row["outcome"]] += 1
        worst.setdefault(pair, {"seconds": 0, "memory_ratio": 0})
        for name in worst[pair]:
            worst[pair][name] = max(worst[pair][name], row[name])
        if row["failed"]:
            classes[f"{pair}: {row['outcome']}: {row['class']}"] += 1
        record.add(row["outcome"], row if row["failed"] else None)
    record.details |= {
        "formats": {pair: dict(table) | worst[pair] for pair, table in tables.items()},
        "classes": dict(classes.most_common()),
        "warnings": sum(row.get("warnings", 0) for row in rows),
        "files opened by libraries": "watched" if any(r.get("watched") for r in rows) else "not",
    }
    return record


def show(record: Record) -> None:
    """Print the outcomes of each format and the kinds of failures."""
    for pair, row in record.details["formats"].items():
        print(f"{pair:<24}" + ", ".join(f"{name} {value:.5g}" for name, value in row.items()))
    for name, count in record.details["classes"].items():
        print(f"{count:6} {name}")
    for pair, names in record.details.get("not run", {}).items():
        print(f"{pair}: not run, needs {names}")
    each = 1000 * record.seconds / max(1, record.tried)
    print(f"{record.tried} mutants, {len(record.failures)} failures, {record.seconds:.0f} s")
    print(f"{each:.0f} s for 1,000 mutants")


if __name__ == "__main__":
    sys.exit(main())
