"""Calibration table of the error bars from coverage studies, and what its intervals cover.

python -m bench.coverage_fit coverage.json --write granpinn/uncertainty/calibration.json
python -m bench.coverage_fit half.json --test other_half.json

The coverage that is printed is always that of truths which the table was not made from: those of
--test, or else each half of the truths with the table of the other half. The table that is written
is made from all.
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
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.coverage import LAW
from granpinn.results.decoding import decode
from granpinn.results.named import Residuals
from granpinn.results.records import Members
from granpinn.uncertainty import calibration, error_bars, of_law
from granpinn.uncertainty.calibration import Calibration, Range
from granpinn.uncertainty.center import center as center_of
from granpinn.uncertainty.center import values_of

Array = npt.NDArray[np.float64]

KNOTS = (0.2, 0.4, 0.5, 0.6)  # mu_s; above 0.5 the errors grow fast (ill-posedness)
CONFIDENCE = 0.9
BEYOND = 1.1  # materials outside of the study by more than this factor are called so
ALARM = 1.2  # times the largest residual of a study: others will have larger ones
FEWEST = 4  # truths to make a table from


class Case(NamedTuple):
    """One identification of a study; mu: true (mu_s, mu_2)."""

    law: str
    mu: Array
    members: Members
    residuals: Residuals
    steps: int


def cases_of(rows: Sequence[dict[str, Any]]) -> list[Case]:
    """The identifications that did not fail."""
    return [
        Case(
            row["law"],
            np.array([row["truth"]["mu_s"], row["truth"]["mu_2"]]),
            decode(Members, row["members"]),
            decode(Residuals, row["residuals"]),
            row["steps"],
        )
        for row in rows
        if row["failure"] is None
    ]


def fit(cases: Sequence[Case], base: Calibration, provenance: str) -> Calibration:
    """The table of a study; what a study cannot say is taken from `base`.

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
        scatter=_scatter(cases, base),
    )
    errors = [of_law.velocity_error(case.residuals, table) for case in cases]
    table = dataclasses.replace(
        table,
        misfit=float(np.quantile(errors, CONFIDENCE)),
        steps=min(base.steps, *(case.steps for case in cases)),
    )
    table = _with_ranges(table, cases)
    table = _with_discrepancy(table, cases)
    reaches = np.array([_reach(case, table) for case in cases])
    missed = np.array([_missed(case) for case in cases])
    return dataclasses.replace(table, widening=_pair(_upper_quantile(missed / reaches)))


def _scatter(cases: Sequence[Case], base: Calibration) -> calibration.Matrix:
    """Pooled covariance of z of members with the data as measured."""
    total, freedom = np.zeros((2, 2)), 0
    for case in cases:
        kept = ~np.array(case.members.redrawn)
        mu = values_of(case.members)[kept]
        z = (mu - mu.mean(axis=0)) / center_of(case.members)[0]
        total, freedom = total + z.T @ z, freedom + max(0, len(z) - 1)
    return _matrix(total / freedom) if freedom >= 2 else base.scatter


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


def _with_discrepancy(table: Calibration, cases: Sequence[Case]) -> Calibration:
    """Second moments of z beyond the scatter, over s^2, averaged around each knot."""
    beyond, mu_s = [], []
    for case in cases:
        center = np.array(center_of(case.members))
        z = (center - case.mu) / center[0]
        scale = error_bars.discrepancy_scale(case.residuals, case.steps, table)
        scatter, _ = error_bars.scatter(case.members, table)
        beyond.append((np.outer(z, z) - scatter) / scale**2)
        mu_s.append(center[0])
    matrices, counts = [], []
    for k in range(len(KNOTS)):
        hat = np.interp(mu_s, KNOTS, np.eye(len(KNOTS))[k])
        if hat.sum() == 0:  # no truth near this knot
            hat = np.ones(len(cases))
        matrices.append(_matrix(np.tensordot(hat, np.array(beyond), 1) / hat.sum()))
        counts.append(hat.sum() ** 2 / np.sum(hat**2))
    return dataclasses.replace(
        table, mu_s=KNOTS, discrepancy=tuple(matrices), discrepancy_weight=float(min(counts))
    )


def _reach(case: Case, table: Calibration) -> Array:
    """Half of the 90 % intervals, in log mu."""
    found = error_bars.estimate(case.members, case.residuals, case.steps, table)
    return np.array(
        [math.log(high / mu) for mu, (_, high) in zip(found.mu, found.intervals, strict=True)]
    )


def _missed(case: Case) -> Array:
    return np.abs(np.log(np.array(center_of(case.members)) / case.mu))


def _upper_quantile(values: Array) -> Array:
    """Of each column, the value that the next one stays below with 90 % probability."""
    place = min(len(values), math.ceil((len(values) + 1) * CONFIDENCE)) - 1
    return np.asarray(np.sort(values, axis=0)[place])


def _matrix(values: Array) -> calibration.Matrix:
    """The nearest symmetric matrix without negative eigenvalues."""
    size, directions = np.linalg.eigh((values + values.T) / 2)
    a = directions * np.maximum(size, 0.0) @ directions.T
    return (float(a[0, 0]), float(a[0, 1])), (float(a[0, 1]), float(a[1, 1]))


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


class Score(NamedTuple):
    """Of one truth: error / mu, error / std, and whether the interval holds it, each [2]."""

    error: Array
    pull: Array
    covered: Array


def score(case: Case, table: Calibration) -> Score:
    found = error_bars.estimate(case.members, case.residuals, case.steps, table)
    error = np.array(found.mu) - case.mu
    covered = [low <= mu <= high for (low, high), mu in zip(found.intervals, case.mu, strict=True)]
    return Score(error / case.mu, error / np.array(found.std), np.array(covered))


def lines_of(scores: Sequence[Score]) -> list[str]:
    """Errors, pulls and coverage of mu_s and mu_2."""
    names = ("median |error| %", "rms %", "mean %", "pull mean", "pull sd", "coverage %")
    lines = [f"{len(scores)} truths" + "".join(f"{name:>18s}" for name in names)]
    error, pull, covered = (np.array(values) for values in zip(*scores, strict=True))
    for k, name in enumerate(("mu_s", "mu_2")):
        e, p = 100 * error[:, k], pull[:, k]
        values = (np.median(abs(e)), np.sqrt(np.mean(e**2)), e.mean(), p.mean(), p.std())
        cells = "".join(f"{value:18.2f}" for value in (*values, 100 * covered[:, k].mean()))
        lines.append(f"{name:{len(lines[0]) - 6 * 18}s}{cells}")
    return lines


def verdicts(pairs: Sequence[tuple[Case, Calibration]]) -> list[str]:
    """How many flows of each law are said to follow mu(I), to contradict it, or neither."""
    counts: dict[str, list[int]] = {}
    for case, table in pairs:
        mu = center_of(case.members)
        follows = of_law.verdict(mu, case.residuals, table).follows
        counts.setdefault(case.law, [0, 0, 0])[(True, False, None).index(follows)] += 1
    return [
        f"{law}: {yes} follow mu(I), {no} contradict it, {open_} cannot be told"
        for law, (yes, no, open_) in counts.items()
    ]


def report(pairs: Sequence[tuple[Case, Calibration]]) -> str:
    """Errors, coverage and verdicts of identifications, each with the table to judge it by."""
    scores = [score(case, table) for case, table in pairs if case.law == LAW]
    return "\n".join([*(lines_of(scores) if scores else []), *verdicts(pairs)])


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """The report of a study with the table that granpinn has."""
    table = calibration.load()
    return report([(case, table) for case in cases_of(rows)])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("studies", nargs="+", type=Path, help="files of bench.coverage")
    parser.add_argument("--test", nargs="+", type=Path, default=[], help="studies to test it on")
    parser.add_argument("--write", type=Path, help="write the table of all studies to this file")
    own = parser.parse_args()
    studies = [json.loads(path.read_text()) for path in own.studies]
    cases = cases_of([row for study in studies for row in study["rows"]])
    law = [case for case in cases if case.law == LAW]
    base, note = calibration.load(), _provenance(studies, len(law))
    try:
        table = fit(law, base, note)
        if own.test:
            rows = [row for path in own.test for row in json.loads(path.read_text())["rows"]]
            tested = [(case, table) for case in cases_of(rows)]
        else:
            halves = [fit(law[k::2], base, note) for k in (1, 0)]
            tested = [(case, halves[i % 2]) for i, case in enumerate(law)]
            tested += [(case, table) for case in cases if case.law != LAW]
    except ValueError as error:
        parser.error(str(error))
    print(report(tested))
    text = json.dumps(dataclasses.asdict(table), indent=1)
    text = re.sub(r"\[\s+([^\[\]]*?)\s+\]", lambda m: f"[{' '.join(m[1].split())}]", text)
    print(text)
    if own.write:
        own.write.write_text(text + "\n")
    return 0


def _provenance(studies: Sequence[dict[str, Any]], truths: int) -> str:
    facts = {
        f"{s['date']}, {s['simulation']['cells']} cells, {s['members']} members, {s['steps']} steps"
        + (f", {' '.join(s['settings'])}" if s["settings"] else "")
        for s in studies
    }
    return f"bench.coverage on {truths} simulated collapses: {'; '.join(sorted(facts))}"


if __name__ == "__main__":
    sys.exit(main())
