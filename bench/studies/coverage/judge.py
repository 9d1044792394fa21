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
from granpinn.uncertainty.held import Held, ends_of

Array = npt.NDArray[np.float64]


class Case(NamedTuple):
    """One identification of a study; mu: true (mu_s, mu_2).

    Attributes:
        held: what its data hold; None in studies that did not record it.
    """

    law: str
    mu: Array
    members: Members
    residuals: Residuals
    steps: int
    held: Held | None = None


def cases_of(rows: Sequence[dict[str, Any]]) -> list[Case]:
    """The identifications that did not fail."""
    return [
        Case(
            row["law"],
            np.array([row["truth"]["mu_s"], row["truth"]["mu_2"]]),
            decode(Members, row["members"]),
            decode(Residuals, row["residuals"]),
            row["steps"],
            _held(row),
        )
        for row in rows
        if row["failure"] is None
    ]


def _held(row: dict[str, Any]) -> Held | None:
    if row.get("I_range") is None:
        return None
    noise = row["residuals"]["noise"] or row["measured_noise"] or 0.0
    return Held(ends_of(row["I_range"], row["flow"]["I0"]), noise, row["independent"])


MISS = 2 / 0.1  # of the interval score: cost of a miss of a 90 % interval
NORMAL = 1.645  # standard deviations


class Score(NamedTuple):
    """Of one truth: error / mu, error / std, whether the interval holds it, and half of the width
    of the interval and the distance of the truth from it, / mu; each [2].
    """

    error: Array
    pull: Array
    covered: Array
    half: Array
    missed: Array


def score(case: Case, table: Calibration) -> Score:
    found = error_bars.estimate(case.members, case.residuals, case.steps, table, held=case.held)
    error = np.array(found.mu) - case.mu
    low, high = np.array(found.intervals).T
    missed = np.maximum(np.maximum(low - case.mu, case.mu - high), 0.0)
    covered, half = missed == 0, (high - low) / 2
    pull = error / np.array(found.std)
    return Score(error / case.mu, pull, covered, half / case.mu, missed / case.mu)


def sharpness(error: Array, half: Array, missed: Array) -> float:
    """Mean interval score over that of intervals of one width, 1.645 times the rms error [n].

    The interval score is the width of an interval, and 20 times the distance of a truth that a
    90 % interval misses (Gneiting and Raftery, J. Am. Stat. Assoc. 102, 2007).
    """
    best = NORMAL * np.sqrt(np.mean(error**2))
    oracle = 2 * best + MISS * np.maximum(abs(error) - best, 0.0)
    return float(np.mean(2 * half + MISS * missed) / np.mean(oracle))


def lines_of(scores: Sequence[Score]) -> list[str]:
    """Errors, pulls, coverage and sharpness of mu_s and mu_2."""
    names = ("median |error| %", "rms %", "mean %", "pull mean", "pull sd", "coverage %", "score")
    lines = [f"{len(scores)} truths" + "".join(f"{name:>18s}" for name in names)]
    error, pull, covered, half, missed = (np.array(v) for v in zip(*scores, strict=True))
    for k, name in enumerate(("mu_s", "mu_2")):
        e, p = 100 * error[:, k], pull[:, k]
        values = [np.median(abs(e)), np.sqrt(np.mean(e**2)), e.mean(), p.mean(), p.std()]
        values += [100 * covered[:, k].mean(), sharpness(error[:, k], half[:, k], missed[:, k])]
        cells = "".join(f"{value:18.2f}" for value in values)
        lines.append(f"{name:{len(lines[0]) - len(names) * 18}s}{cells}")
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
