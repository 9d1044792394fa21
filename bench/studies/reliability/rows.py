"""The rows of mutants or faults: one line of JSON each; several runs make one record.

    python -m bench.studies.reliability.rows a.rows b.rows --out results/mutants.json

The first line of each file says on which machine and by which command it was made.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench.studies.reliability.record import RESULTS, Record, joined


def begin(path: Path, command: str, gate: str = "F-2") -> None:
    """A new file with the line about its run."""
    head = {"run": Record(gate, command=command).as_json()}
    path.write_text(json.dumps(head) + "\n", encoding="utf-8")


def read(path: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The run of a file, and its rows; a last line that was cut off is left out."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    found = [json.loads(line) for line in lines if line.endswith("}\n")]
    return found[0]["run"], found[1:]


def merged(paths: Sequence[Path]) -> dict[str, Any]:
    """One record of several runs; a mutant or a fault that ran several times counts once."""
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    runs = []
    for path in paths:
        run, found = read(path)
        kind = KINDS[run["gate"]]
        run["seconds"] = max((row.get(kind.clock, 0) for row in found), default=0)
        runs.append(run)
        for row in found:
            name = tuple(row.get(key) for key in kind.name)
            if not rows.get(name, {}).get("failed"):
                rows[name] = row
    record = kind.gather(rows.values())
    record.seconds = sum(run["seconds"] for run in runs)
    record.command = "\n".join(run["command"] for run in runs)
    whole = record.as_json(device=joined(run["device"] for run in runs))
    whole["date"] = joined(run["date"] for run in runs)
    whole["versions"] = {
        name: joined(run["versions"][name] for run in runs) for name in runs[0]["versions"]
    }
    return whole


def _mutants(rows: Iterable[dict[str, Any]]) -> Record:
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
    # A format counts as not run only if no run had its library.
    if left := {pair: names for pair, names in missing.items() if pair not in tables}:
        record.details["not run"] = left
    return record


def _faults(rows: Iterable[dict[str, Any]]) -> Record:
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


class Kind(NamedTuple):
    """What the rows of a gate are: the keys of their names and of their time, and the record."""

    name: tuple[str, ...]
    clock: str
    gather: Callable[[Iterable[dict[str, Any]]], Record]


KINDS = {
    "F-2": Kind(("format", "command", "mutant"), "at", _mutants),
    "F-5, T-3": Kind(("case", "mode", "at"), "after", _faults),
}


def show(whole: dict[str, Any]) -> None:
    """Print the outcomes of each format or case, and the kinds of failures."""
    details = whole["details"]
    for name, row in (details.get("formats") or details.get("cases", {})).items():
        print(f"{name:<24}" + ", ".join(f"{key} {value:.5g}" for key, value in row.items()))
    for name, count in details.get("classes", {}).items():
        print(f"{count:6} {name}")
    for pair, names in details.get("not run", {}).items():
        print(f"{pair}: not run, needs {names}")
    print(f"{whole['tried']} tried, {whole['failed']} failures, {whole['seconds']:.0f} s")


def main(argv: list[str] | None = None) -> int:
    """Write the record of several runs; exit code 1 if one ended as it must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("rows", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, help=f"the record, such as {RESULTS.name}/mutants.json")
    options = parser.parse_args(argv)
    whole = merged(options.rows)
    if options.out is not None:
        write(options.out, whole)
    show(whole)
    return int(bool(whole["failed"]))


def write(path: Path, whole: dict[str, Any]) -> None:
    """Write a record as JSON."""
    path.write_text(json.dumps(whole, indent=1, allow_nan=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
