"""All scenes of a folder in one table: their own laws, noise and the plain momentum balance.

    python -m bench.studies.grains.table SCENES --json scenes.json --csv scenes.csv

The CSV has the points of every law, for drawing: scene, material, kind, I, mu, standard error.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from pathlib import Path
from typing import Any

from bench.studies import raw
from bench.studies.experiment.commands import ExperimentError
from bench.studies.grains.make import SUMMARY, line
from bench.studies.grains.run import scenes_in

COLUMNS = ("scene", "material", "kind", "I", "mu", "se")


def points(summary: dict[str, Any]) -> list[tuple[Any, ...]]:
    """The rows of the CSV of one scene."""
    kinds = {"along_D": summary["own"]["along_D"], "norm": summary["own"]["norm"]}
    kinds |= {"balance": summary["balance"] or {"points": []}}
    name = (summary["scene"], summary["material"])
    return [
        (*name, kind, *(f"{p[c]:.6g}" for c in ("I", "mu", "se")))
        for kind, law in kinds.items()
        for p in law["points"]
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", type=Path, help="folder of the scenes")
    parser.add_argument("--json", type=Path, help="file for all that the scenes say of themselves")
    parser.add_argument("--csv", type=Path, help="file for the points of their laws")
    chosen = parser.parse_args()
    try:
        found = [json.loads((s / SUMMARY).read_text()) for s in scenes_in(chosen.scenes)]
    except (ExperimentError, OSError, ValueError) as error:
        print(f"bench.studies.grains.table: {error}", file=sys.stderr)
        return 1
    for summary in found:
        print(line(summary))
    raw.write(chosen.json, {"scenes": found})
    if chosen.csv is not None:
        with chosen.csv.open("w", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(COLUMNS)
            rows.writerows(row for summary in found for row in points(summary))
    return 0


if __name__ == "__main__":
    sys.exit(main())
