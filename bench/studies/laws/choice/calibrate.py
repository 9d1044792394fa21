"""The error of free curves, from flows with known laws: the entry `free_curve` of a calibration.

    python -m bench.studies.laws.choice.run --numbers 100 106 --noise 0 --json first.json
    python -m bench.studies.laws.choice.calibrate first.json ... --write calibration.json
    python -m bench.studies.laws.choice.calibrate --widths second.json --write calibration.json
    python -m bench.studies.laws.choice.calibrate --shorter fewer.json --write calibration.json

The third one takes the widths of the bands from new flows, of which the parts of the error know
nothing. The fourth one tests new flows with fewer steps: where their curves are no worse than the
entry says, it holds from that number on.

Flows with cohesion give no error of a curve, and flows without it give the cohesion that is found
where there is none. The widths of the bands are quantiles over the flows, with the standard
deviations that the runs state: the half-widths of their bands over the widening with which these
were drawn, which every run records.
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

from bench.studies import raw
from bench.studies.coverage.calibrate import text_of
from granpinn.arrays import Float64
from granpinn.physics.laws import cohesive
from granpinn.uncertainty import calibration
from granpinn.uncertainty.calibration import FreeCurveError

MODES = 5
COHESIVE = cohesive.LAW.name


def error_of(
    rows: Sequence[dict[str, Any]], noise: float, steps: int, provenance: str
) -> FreeCurveError:
    """The entry.

    Args:
        noise: largest noise of the vectors in the study, over the rms speed.
        steps: of the trainings.
    """
    plain = _without_cohesion(rows)
    cohesion = [_cohesion(row) / row["pressure"] for row in plain if row["comparison"]]
    modes = modes_of(plain)
    wide, widest = _widths(plain, modes)
    wet = [_error_of_cohesion(r) for r in rows if r["law"] == COHESIVE and r["comparison"]]
    c, percent = _rms(cohesion), 100 * _rms(wet)
    return FreeCurveError(
        tuple(modes.tolist()), wide, widest, c, percent, noise, steps, len(plain), provenance
    )


def modes_of(rows: Sequence[dict[str, Any]]) -> Float64:
    """Rms of the Legendre parts of the relative errors of the curves [MODES]."""
    relative = [np.array(row["mu"]) / np.array(row["true"]) - 1 for row in rows]
    amplitudes = [legendre.legfit(_xi(r), r, MODES - 1) for r in relative]
    return np.asarray(np.sqrt(np.mean(np.square(amplitudes), axis=0)))


def for_fewer_steps(
    rows: Sequence[dict[str, Any]], entry: FreeCurveError, steps: int, dates: str
) -> FreeCurveError:
    """The entry for trainings from `steps` on.

    Raises:
        ValueError: the curves of these rows are worse than the entry says.
    """
    plain = _without_cohesion(rows)
    found, known = (float(np.linalg.norm(m)) for m in (modes_of(plain), entry.modes))
    if found > known:
        raise ValueError(
            f"after {steps} steps the parts of the error add up to {found:.3g}, in the entry to "
            f"{known:.3g}: make an entry from such trainings"
        )
    added = f"; {len(plain)} flows with {steps} steps of {dates} are no worse"
    return dataclasses.replace(entry, steps=steps, provenance=entry.provenance + added)


def with_widths(
    rows: Sequence[dict[str, Any]], entry: FreeCurveError, dates: str
) -> FreeCurveError:
    """The entry with the widths that follow from new flows."""
    plain = _without_cohesion(rows)
    wide, widest = _widths(plain, np.array(entry.modes))
    added = f"; widths of {len(plain)} other flows of {dates}"
    return dataclasses.replace(
        entry, widening=wide, farthest=widest, provenance=entry.provenance + added
    )


def held(rows: Sequence[dict[str, Any]], entry: FreeCurveError) -> str:
    """How many of these curves lie in their bands, with the widths of the other half of flows."""
    plain, modes = _without_cohesion(rows), np.array(entry.modes)
    inside = 0
    for own in (0, 1):
        widths = with_widths([r for r in plain if r["number"] % 2 != own], entry, "").widening
        inside += sum(_farthest(r, modes) <= widths for r in plain if r["number"] % 2 == own)
    return f"{inside} of {len(plain)} curves in their bands"


def _widths(rows: Sequence[dict[str, Any]], modes: Float64) -> tuple[float, float]:
    """The largest errors of curves over their standard deviations: 90 % and 99 % are smaller."""
    ratios = [_farthest(row, modes) for row in rows]
    wide, widest = np.quantile(ratios, (0.9, 0.99)).tolist()
    return wide, widest


def _without_cohesion(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return [row for row in rows if row["law"] != COHESIVE and row.get("low")]


def _cohesion(row: dict[str, Any]) -> float:
    own = next(c for c in row["comparison"] if c["law"] == COHESIVE)
    return float(own["parameters"]["c"]["value"])


def _error_of_cohesion(row: dict[str, Any]) -> float:
    return _cohesion(row) / float(row["truth"]["c"]) - 1


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _farthest(row: dict[str, Any], modes: Float64) -> float:
    """The largest error of a curve over its standard deviation with other modes."""
    mu, true = np.array(row["mu"]), np.array(row["true"])
    stated = np.subtract(row["high"], row["low"]) / 2 / row["bands"]["widening"]
    square = np.square(legendre.legvander(_xi(mu), MODES - 1))
    change = square @ (np.square(modes) - np.square(row["bands"]["modes"]))
    variance = np.maximum(stated**2 + mu**2 * change, 1e-12)
    return float(np.max(np.abs(mu - true) / np.sqrt(variance)))


def _xi(values: Float64) -> Float64:
    """-1 to 1 over a curve, which is even in log I."""
    return np.linspace(-1, 1, values.size)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("runs", nargs="*", type=Path)
    parser.add_argument("--shorter", type=Path, help="a run with fewer steps, to test the entry")
    parser.add_argument("--widths", type=Path, help="a run with the entry, for its widths alone")
    parser.add_argument("--write", type=Path, help="the table that gets the entry")
    own = parser.parse_args()
    if [bool(own.runs), bool(own.shorter), bool(own.widths)].count(True) != 1:
        parser.error("give the runs that make the entry, or --shorter or --widths with another run")
    contents, _, dates = raw.rows_and_dates(own.runs or [own.shorter or own.widths])
    bands = [content.get("bands") for content in contents]
    if not (own.shorter or all(bands)):
        parser.error("a run does not record with which entry its bands were drawn: run it again")
    pairs = zip(contents, bands, strict=True)
    rows = [row | {"bands": of_run} for content, of_run in pairs for row in content["rows"]]
    steps = min(content["steps"] for content in contents)
    table = calibration.load()
    before = table.free_curve
    if before is None:
        parser.error(f"{calibration.PATH.name} has no entry free_curve, which states the noise")
    if own.widths:
        found = with_widths(rows, before, dates)
        print(held(rows, before))
    elif own.shorter:
        found = for_fewer_steps(rows, before, steps, dates)
    else:
        found = error_of(rows, before.noise, steps, f"bench.studies.laws.choice.run of {dates}")
    print(json.dumps(dataclasses.asdict(found), indent=1))
    if own.write is not None:
        table = calibration.load(own.write)
        own.write.write_text(text_of(dataclasses.replace(table, free_curve=found)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
