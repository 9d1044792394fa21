"""The error of the laws on halves of the data: the entry `halves` of a calibration.

    python -m bench.studies.laws.verdict.calibrate verdict.json ... --write calibration.json

Takes the clean flows of runs of bench.studies.laws.verdict.run. `--judge` names other runs: their
flows are counted again with the limits that follow from the entry.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from bench.studies import raw
from bench.studies.coverage.calibrate import text_of
from bench.studies.laws.verdict.flows import CLEAN
from bench.studies.laws.verdict.table import is_named, table
from granpinn.results.parts import SPLITS
from granpinn.uncertainty import calibration
from granpinn.uncertainty.calibration import HalvesError
from granpinn.uncertainty.of_parts import LEVEL

PARAMETERS = 2  # of mu(I) that are free
OTHER_LAWS = "do not follow one law"  # the words of a verdict by the parts


def error_of(
    rows: Sequence[dict[str, Any]], noise: tuple[float, float], steps: int, provenance: str
) -> HalvesError:
    """The entry, from rows of clean flows; ValueError: no flow has one of the splits."""
    clean = [row for row in rows if row["kind"] == CLEAN and row["parts"]]
    sd = {}
    for name in SPLITS:
        mine = [s for row in clean for s in row["parts"] if s["name"] == name]
        squares = [s["percent"] ** 2 - s["residual_percent"] ** 2 for s in mine if s["percent"]]
        if not squares:
            raise ValueError(f"no clean flow has a difference in {name}")
        sd[name] = max(float(np.mean(squares)), 0.0) ** 0.5 / 100
    return HalvesError(sd, noise, steps, len(clean), provenance)


def limit_percent(split: dict[str, Any], entry: HalvesError, splits: int) -> float:
    """The limit of a difference with the error of an entry, %.

    The effective number of boxes behind the residuals counts as that of the flows.
    """
    std = np.hypot(split["residual_percent"], 100 * entry.sd[split["name"]])
    quantile = special.fdtri(PARAMETERS, entry.flows, 1 - LEVEL / splits)
    return float(std * np.sqrt(PARAMETERS * quantile))


def judged(row: dict[str, Any], entry: HalvesError) -> dict[str, Any]:
    """A row with the answer of the parts by an entry; that of the residuals stays."""
    words = (row["verdict"] or {}).get("words", "")
    by_residuals = (row["verdict"] or {}).get("follows") is False and OTHER_LAWS not in words
    splits = [s for s in row["parts"] or () if s["percent"] is not None]
    found = {
        (s["name"], s["percent"] > 0)
        for s in splits
        if abs(s["percent"]) > limit_percent(s, entry, len(splits))
    }
    follows = False if found or by_residuals else (row["verdict"] or {}).get("follows")
    return row | {"verdict": {"follows": follows}, "named": is_named(row["kind"], found)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--write", type=Path, help="the table that gets the entry")
    parser.add_argument(
        "--noise",
        nargs=2,
        type=float,
        default=(0.03, 0.12),
        help="of the rms speed: least, most",
    )
    parser.add_argument("--judge", nargs="+", type=Path, default=[], help="runs to count again")
    own = parser.parse_args()
    contents, rows, dates = raw.rows_and_dates(own.runs)
    steps = min(content["steps"] for content in contents)
    found = error_of(rows, own.noise, steps, f"bench.studies.laws.verdict.run of {dates}")
    print(json.dumps(dataclasses.asdict(found), indent=1))
    print(table([judged(row, found) for row in raw.rows_and_dates(own.judge)[1]]))
    if own.write is not None:
        entries = calibration.load(own.write)
        own.write.write_text(text_of(dataclasses.replace(entries, halves=found)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
