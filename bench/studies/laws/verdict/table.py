"""What the verdicts say of the planted violations: counts by kind and noise.

python -m bench.studies.laws.verdict.table verdict.json
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence, Set
from pathlib import Path
from typing import Any

from bench.studies.laws.verdict.flows import KINDS
from granpinn.results import Result


def named(kind: str, result: Result) -> bool:
    """Whether the part that was planted is named; of kinds without a part, any part."""
    if result.parts is None:
        return False
    return is_named(kind, {(s.name, (s.percent or 0) > 0) for s in result.parts.different})


def is_named(kind: str, found: Set[tuple[str, bool]]) -> bool:
    """Whether the part that was planted is among the splits, each with whether it needs more."""
    wanted = KINDS[kind].named
    if not wanted:
        return bool(found)
    return any((split, more) in found for split, second in wanted for more in second)


def counts(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each kind and noise: flows, those found, those whose part is named."""
    keys = dict.fromkeys((row["kind"], row["noise"]) for row in rows)
    made = []
    for kind, noise in keys:
        mine = [row for row in rows if (row["kind"], row["noise"]) == (kind, noise)]
        follows = [(row["verdict"] or {}).get("follows") for row in mine]
        made.append(
            {
                "kind": kind,
                "noise": noise,
                "flows": len(mine),
                "found": sum(value is False for value in follows),
                "no_answer": sum(value is None for value in follows),
                "named": sum(bool(row["named"]) for row in mine),
            }
        )
    return made


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The counts as lines of text."""
    lines = [f"{'kind':14s}{'noise':>7s}{'flows':>7s}{'found':>7s}{'named':>7s}{'no answer':>11s}"]
    lines += [
        f"{c['kind']:14s}{100 * c['noise']:6.3g} %{c['flows']:6d}{c['found']:7d}{c['named']:7d}"
        f"{c['no_answer']:11d}"
        for c in counts(rows)
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        print(table(json.loads(Path(name).read_text())["rows"]))
