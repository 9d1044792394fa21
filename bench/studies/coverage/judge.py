"""Identifications of the coverage study judged with a calibration: errors, coverage, verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.studies.coverage.materials import LAW
from granpinn.results.decoding import decode
from granpinn.results.named import Residuals
from granpinn.results.records import Members
from granpinn.uncertainty import error_bars, of_law
from granpinn.uncertainty.calibration import Calibration
from granpinn.uncertainty.center import center

Array = npt.NDArray[np.float64]


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
        mu = center(case.members)
        follows = of_law.verdict(mu, case.residuals, table, noise=0.0).follows
        counts.setdefault(case.law, [0, 0, 0])[(True, False, None).index(follows)] += 1
    return [
        f"{law}: {yes} follow mu(I), {no} contradict it, {open_} cannot be told"
        for law, (yes, no, open_) in counts.items()
    ]


def report(pairs: Sequence[tuple[Case, Calibration]]) -> str:
    """Errors, coverage and verdicts of identifications, each with the table to judge it by."""
    scores = [score(case, table) for case, table in pairs if case.law == LAW]
    return "\n".join([*(lines_of(scores) if scores else []), *verdicts(pairs)])
