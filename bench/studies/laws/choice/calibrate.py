"""The error of free curves, from flows with known laws: the entry `free_curve` of a calibration.

    python -m bench.studies.laws.choice.run --numbers 100 106 --noise 0 --json first.json
    python -m bench.studies.laws.choice.calibrate first.json ... --write calibration.json

Flows with cohesion give no error of a curve, and flows without it give the cohesion that is found
where there is none. The widths of the bands are quantiles over the flows, with the standard
deviations that the runs state, divided by the half-width of their bands.
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
from numpy.polynomial import legendre

from bench.studies.coverage.calibrate import rows_and_dates, text_of
from granpinn.arrays import Float64
from granpinn.physics.laws import cohesive
from granpinn.uncertainty import calibration
from granpinn.uncertainty.calibration import FreeCurveError

MODES = 5
COHESIVE = cohesive.LAW.name


def error_of(
    rows: Sequence[dict[str, Any]], before: FreeCurveError, provenance: str
) -> FreeCurveError:
    """The entry.

    Args:
        before: the entry with which the bands in the rows were made.
    """
    plain = [row for row in rows if row["law"] != COHESIVE and row.get("low")]
    amplitudes, cohesion = [], []
    for row in plain:
        relative = np.array(row["mu"]) / np.array(row["true"]) - 1
        amplitudes.append(legendre.legfit(_xi(relative), relative, MODES - 1))
        if row["comparison"]:
            cohesion.append(_cohesion(row) / row["pressure"])
    modes = np.sqrt(np.mean(np.square(amplitudes), axis=0))
    ratios = [_farthest(row, before, modes) for row in plain]
    wide, widest = np.quantile(ratios, (0.9, 0.99)).tolist()
    wet = [_error_of_cohesion(r) for r in rows if r["law"] == COHESIVE and r["comparison"]]
    c, percent = _rms(cohesion), 100 * _rms(wet)
    return FreeCurveError(
        tuple(modes.tolist()), wide, widest, c, percent, before.noise, len(plain), provenance
    )


def _cohesion(row: dict[str, Any]) -> float:
    own = next(c for c in row["comparison"] if c["law"] == COHESIVE)
    return float(own["parameters"]["c"]["value"])


def _error_of_cohesion(row: dict[str, Any]) -> float:
    return _cohesion(row) / float(row["truth"]["c"]) - 1


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _farthest(row: dict[str, Any], before: FreeCurveError, modes: Float64) -> float:
    """The largest error of a curve over its standard deviation with other modes."""
    mu, true = np.array(row["mu"]), np.array(row["true"])
    stated = np.subtract(row["high"], row["low"]) / 2 / before.widening
    square = np.square(legendre.legvander(_xi(mu), MODES - 1))
    change = square @ (np.square(modes) - np.square(before.modes))
    variance = np.maximum(stated**2 + mu**2 * change, 1e-12)
    return float(np.max(np.abs(mu - true) / np.sqrt(variance)))


def _xi(values: Float64) -> Float64:
    """-1 to 1 over a curve, which is even in log I."""
    return np.linspace(-1, 1, values.size)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--write", type=Path, help="the table that gets the entry")
    own = parser.parse_args()
    _, rows, dates = rows_and_dates(own.runs)
    table = calibration.load()
    before = table.free_curve
    if before is None:
        parser.error(f"{calibration.PATH.name} has no entry free_curve, which made the bands")
    found = error_of(rows, before, f"bench.studies.laws.choice.run of {dates}")
    print(json.dumps(dataclasses.asdict(found), indent=1))
    if own.write is not None:
        table = calibration.load(own.write)
        own.write.write_text(text_of(dataclasses.replace(table, free_curve=found)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
