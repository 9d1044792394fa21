"""Makes the shipped calibration of the error bars from coverage studies.

python -m bench.studies.coverage.calibrate coverage.json --write
python -m bench.studies.coverage.calibrate coverage.json --shorter steps_10000.json --write
python -m bench.studies.coverage.calibrate half.json --test other_half.json

--write writes the shipped table of the level of the studies (granpinn/uncertainty/calibration.json,
calibration_V0.json at level V0), or the file that it names.
The coverage that is printed is always that of truths which the table was not made from: those of
--test, or else each half of the truths with the table of the other half; after fewer steps
(--shorter) each truth with the table of the others. The table that is written is made from all.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.studies import raw
from bench.studies.coverage.discrepancy import at_least, matrix, with_discrepancy
from bench.studies.coverage.judge import Case, cases_of, report
from bench.studies.coverage.materials import LAW
from granpinn.config import Config
from granpinn.uncertainty import calibration, error_bars, of_law
from granpinn.uncertainty.calibration import Calibration, Range, ShortTraining
from granpinn.uncertainty.center import center as center_of
from granpinn.uncertainty.center import values_of

Array = npt.NDArray[np.float64]

CONFIDENCE = 0.9
BEYOND = 1.1  # materials outside of the study by more than this factor are called so
ALARM = 1.2  # times the largest residual of a study: others will have larger ones
FEWEST = 4  # truths to make a table from
SHIPPED = Path()  # stands for the shipped table of the level


def fit(cases: Sequence[Case], base: Calibration, provenance: str) -> Calibration:
    """The table of a study; what a study cannot say is taken from `base`.

    It has no entries on other inertial numbers and noise: other_data.py makes them from it.

    Args:
        cases: of flows that obey mu(I).
    """
    if len(cases) < FEWEST:
        raise ValueError(f"a table needs at least {FEWEST} truths, got {len(cases)}")
    table = dataclasses.replace(
        base,
        provenance=provenance,
        provisional=False,
        widening=(1.0, 1.0),
        shorter=(),
        reach=None,
        noise=None,
        scatter=_scatter(cases, base),
    )
    errors = [of_law.velocity_error(case.residuals, table) for case in cases]
    table = dataclasses.replace(
        table,
        misfit=float(np.quantile(errors, CONFIDENCE)),
        steps=min(case.steps for case in cases),
    )
    table = _with_ranges(table, cases)
    table = with_discrepancy(table, cases)
    reaches = np.array([reach(case, table) for case in cases])
    errors_of = np.array([missed(case) for case in cases])
    return dataclasses.replace(table, widening=_pair(upper_quantile(errors_of / reaches)))


def shorter(cases: Sequence[Case], table: Calibration, provenance: str) -> ShortTraining:
    """What a study of one shorter length adds to the table of the usual one.

    Its intervals keep the widening of the table, so what they lack is put into the discrepancy. No
    error counts as smaller than after the usual steps: where it is, an error of short trainings
    makes up for one of these simulations, and other data need not have that one.
    """
    (steps,) = {case.steps for case in cases}
    alone = with_discrepancy(dataclasses.replace(table, steps=steps, shorter=()), cases)
    reaches = np.array([reach(case, alone) for case in cases])
    missing = upper_quantile(np.array([missed(case) for case in cases]) / reaches)
    factor = np.maximum(1.0, missing)
    raised = np.outer(factor, factor)
    pairs = zip(alone.discrepancy, table.discrepancy, strict=True)
    matrices = tuple(at_least(np.array(D) * raised, usual) for D, usual in pairs)
    return ShortTraining(steps, matrices, len(cases), provenance)


def _scatter(cases: Sequence[Case], base: Calibration) -> calibration.Matrix:
    """Pooled covariance of z of members with the data as measured."""
    total, freedom = np.zeros((2, 2)), 0
    for case in cases:
        kept = ~np.array(case.members.redrawn)
        mu = values_of(case.members)[kept]
        z = (mu - mu.mean(axis=0)) / center_of(case.members)[0]
        total, freedom = total + z.T @ z, freedom + max(0, len(z) - 1)
    return matrix(total / freedom) if freedom >= 2 else base.scatter


def _with_ranges(table: Calibration, cases: Sequence[Case]) -> Calibration:
    """Residuals: the median is 1x, ALARM times the largest the limit. The range of the materials.

    The truths of one study have much the same misfit: the slope stays as it is.
    """
    errors = np.array([of_law.velocity_error(case.residuals, table) for case in cases])
    found = {}
    for name, old in table.residuals.items():
        rms = np.array([case.residuals[name] for case in cases])
        over = np.log10(rms) - old.slope * np.log10(errors)
        middle = float(np.median(over))
        found[name] = Range(middle, old.slope, float(ALARM * 10 ** (np.max(over) - middle)))
    mu = np.array([case.mu for case in cases])
    ranges = {"valid_mu_s": mu[:, 0], "valid_ratio": mu[:, 1] / mu[:, 0]}
    limits = {
        name: (float(values.min() / BEYOND), float(values.max() * BEYOND))
        for name, values in ranges.items()
    }
    return dataclasses.replace(table, residuals=found, **limits)  # type: ignore[arg-type]


def reach(case: Case, table: Calibration) -> Array:
    """Half of the 90 % intervals, in log mu."""
    found = error_bars.estimate(case.members, case.residuals, case.steps, table, held=case.held)
    return np.array(
        [math.log(high / mu) for mu, (_, high) in zip(found.mu, found.intervals, strict=True)]
    )


def missed(case: Case) -> Array:
    """The error, in log mu."""
    return np.abs(np.log(np.array(center_of(case.members)) / case.mu))


def upper_quantile(values: Array) -> Array:
    """Of each column, the value that the next one stays below with 90 % probability."""
    place = min(len(values), math.ceil((len(values) + 1) * CONFIDENCE)) - 1
    return np.asarray(np.sort(values, axis=0)[place])


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("studies", nargs="+", type=Path, help="files of coverage.run")
    parser.add_argument(
        "--shorter",
        nargs="+",
        type=Path,
        default=[],
        help="studies of fewer steps, one length each",
    )
    parser.add_argument("--test", nargs="+", type=Path, default=[], help="studies to test it on")
    parser.add_argument(
        "--write",
        type=Path,
        nargs="?",
        const=SHIPPED,
        metavar="FILE",
        help="write the table of all studies; without a name: the shipped calibration",
    )
    own = parser.parse_args()
    studies, rows, _ = raw.rows_and_dates(own.studies)
    cases = cases_of(rows)
    law = [case for case in cases if case.law == LAW]
    try:
        level = _level(studies)
        base = calibration.of_level(level) or calibration.load()
        note = _provenance(studies, len(law))
        table = fit(law, base, note)
        if own.test:
            tested = [(case, table) for case in cases_of(raw.rows_and_dates(own.test)[1])]
        else:
            halves = [fit(law[k::2], base, note) for k in (1, 0)]
            tested = [(case, halves[i % 2]) for i, case in enumerate(law)]
            tested += [(case, table) for case in cases if case.law != LAW]
        print(report(tested))
        table = with_shorter(table, own.shorter)
    except ValueError as error:
        parser.error(str(error))
    text = text_of(table)
    print(text)
    if own.write:
        (calibration.PATHS[level] if own.write == SHIPPED else own.write).write_text(text + "\n")
    return 0


def with_shorter(table: Calibration, paths: Sequence[Path]) -> Calibration:
    """The table with studies of fewer steps; it prints what the table of the others says of each
    of their flows.
    """
    found = []
    for path in paths:
        content = json.loads(path.read_text(encoding="utf-8"))
        cases = [case for case in cases_of(content["rows"]) if case.law == LAW]
        note = _provenance([content], len(cases))
        tested = []
        for k, case in enumerate(cases):
            others = shorter([*cases[:k], *cases[k + 1 :]], table, note)
            tested.append((case, dataclasses.replace(table, shorter=(others,))))
        print(f"after {content['steps']} steps:")
        print(report(tested))
        found.append(shorter(cases, table, note))
    return dataclasses.replace(table, shorter=tuple(sorted(found, key=lambda s: s.steps)))


def text_of(table: Calibration) -> str:
    """The table as JSON, short lists in one line."""
    text = json.dumps(dataclasses.asdict(table), indent=1)
    return re.sub(r"\[\s+([^\[\]]*?)\s+\]", lambda m: f"[{' '.join(m[1].split())}]", text)


def _level(studies: Sequence[dict[str, Any]]) -> str:
    """The level of the studies, which must be one; V2 shares the table of V1."""
    levels: set[str] = set()
    for words in (study["settings"] for study in studies):
        stated = dict(zip(words[::2], words[1::2], strict=True))
        levels.add(stated.get("--level", Config().level))
    if len({calibration.PATHS[level] for level in levels}) > 1:
        raise ValueError(f"the studies must have one level, got {', '.join(sorted(levels))}")
    return min(levels)


def _provenance(studies: Sequence[dict[str, Any]], truths: int) -> str:
    facts = {
        f"{s['date']}, {s['simulation']['cells']} cells, {s['members']} members, {s['steps']} steps"
        + (f", {' '.join(s['settings'])}" if s["settings"] else "")
        for s in studies
    }
    return f"bench.studies.coverage on {truths} simulated collapses: {'; '.join(sorted(facts))}"


if __name__ == "__main__":
    sys.exit(main())
