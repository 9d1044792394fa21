"""The error model of granpinn/uncertainty/error_model.json, fitted to results/rows.csv.

python -m bench.studies.coverage.fit --write

The numbers are those of the largest likelihood (likelihood.py). Scenes of grains count once,
whatever the number of their seeds. Coefficients have a weak prior, and the sign with which errors
grow.

Then every family of populations is left out in turn (`table.ALIKE`, those of one draw of flows, a
number of steps, a scene of grains), and judged by the model of the others. The constants get the
least factors with which the 90 % intervals hold LEAST of the truths of each of these populations.
Those of few flows do not count, nor does a number of steps, which no other population is like.

--write also writes the table of this to results/report.md. It takes three minutes.
Defends: 85 to 97 % of the truths of every population that the fit has not seen, scores up to 1.3.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench.studies.coverage import table
from bench.studies.coverage.likelihood import (
    FREEDOM,
    Array,
    Data,
    data_of,
    errors_at,
    most_likely,
    places_of,
    some,
    weights_at,
)
from bench.studies.coverage.table import GRAINS, Row
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.error_model import COEFFICIENTS, WORDS, ErrorModel, quantities

REPORT = table.PATH.with_name("report.md")
LEAST, MANY = 0.85, 40
SHARE = 0.9
MISS = 2 / (1 - SHARE)  # of the interval score: cost of a miss
NORMAL = 1.645  # half of the central 90 % of a normal distribution, in sd


def model_of(p: Array, rows: Sequence[Row], provenance: str, usual: ErrorModel) -> ErrorModel:
    """The model with the parameters of a fit to these rows; `usual`: what they do not show."""
    C = len(COEFFICIENTS)
    lower, upper = (
        dict(zip(COEFFICIENTS, map(_digits, part), strict=True))
        for part in p[: 2 * C].reshape(2, C).tolist()
    )
    values = [quantities(row.known) for row in rows]
    tested = {
        name: (_digits(min(v[name] for v in values)), _digits(max(v[name] for v in values)))
        for name in WORDS
    }
    level, tilt = np.exp(p[-2:]).tolist()
    return dataclasses.replace(
        usual,
        provenance=provenance,
        freedom=FREEDOM,
        lower=lower,
        upper=upper,
        correlation=_digits(np.tanh(p[2 * C])),
        level=_digits(level),
        tilt=_digits(tilt),
        tested=tested,
    )


def _digits(value: float) -> float:
    return float(f"{value:.3g}")


class Judged(NamedTuple):
    """What a model says of one identification, against the truth.

    Attributes:
        pull: |error of log mu| at both ends, over the half-width of the 90 % interval [2].
        error: of mu_s and mu_2, over the truth [2].
        half, missed: half-width of their 90 % intervals, and distance of the truth from them, over
            the truth [2].
    """

    pull: Array
    error: Array
    half: Array
    missed: Array


def judged(row: Row, model: ErrorModel) -> Judged:
    """Judge one identification by a model."""
    x = places_of(row)
    W = weights_at(row, x)
    variances = np.diag(W @ (model.method(row.known) + model.grains(row.known)) @ W.T)
    pull = np.abs(errors_at(row, x)) / (model.half_width() * np.sqrt(variances))
    found = error_bars.estimate(row.members, row.known, model).parameters
    low, high = np.array([found[name].interval_90 for name in row.known.parameters]).T
    truth, mu = np.array(row.truth), np.array(row.known.mu)
    missed = np.maximum(np.maximum(low - truth, truth - high), 0.0)
    return Judged(np.resize(pull, 2), mu / truth - 1, (high - low) / 2 / truth, missed / truth)


def sharpness(error: Array, half: Array, missed: Array) -> Array:
    """Mean interval score over that of intervals of one width, 1.645 times the rms error [n].

    The interval score is the width of an interval, and 20 times the distance of a truth that a
    90 % interval misses (Gneiting and Raftery, J. Am. Stat. Assoc. 102, 2007).
    """
    best = NORMAL * np.sqrt(np.mean(error**2, axis=0))
    oracle = 2 * best + MISS * np.maximum(np.abs(error) - best, 0.0)
    return np.asarray(np.mean(2 * half + MISS * missed, axis=0) / np.mean(oracle, axis=0))


def line_of(name: str, many: Sequence[Judged]) -> str:
    """A line of `report`."""
    pull, error, half, missed = (np.array(values) for values in zip(*many, strict=True))
    cells = [f"| {name:18s} | {len(many):3d} |"]
    for values in (np.mean(missed == 0, axis=0), np.mean(pull <= 1, axis=0)):
        cells.append(" / ".join(f"{100 * v:3.0f}" for v in values) + " |")
    cells.append(" / ".join(f"{v:.2f}" for v in sharpness(error, half, missed)) + " |")
    cells.append(" / ".join(f"{100 * v:4.1f}" for v in np.median(half, axis=0)) + " |")
    return " ".join(cells)


def raised(pulls: Sequence[Sequence[Array]]) -> Array:
    """The least factors with which every population holds LEAST of its truths at either end [2].

    Args:
        pulls: of the rows of every population that counts.
    """
    needed = [np.quantile(np.array(many), LEAST, axis=0, method="higher") for many in pulls]
    return np.asarray(np.max(needed, axis=0))


def left_out(rows: Sequence[Row], data: Data, usual: ErrorModel) -> list[ErrorModel]:
    """For each row the model of the families other than its own."""
    families = np.array([row.family for row in rows])
    of_family = {}
    for family in dict.fromkeys(families.tolist()):
        others = families != family
        known = [row for row, other in zip(rows, others, strict=True) if other]
        of_family[family] = model_of(most_likely(some(data, others)), known, "", usual)
    return [of_family[row.family] for row in rows]


def with_constants(model: ErrorModel, factors: Array) -> ErrorModel:
    """The model with errors at both ends that are larger by these factors [2]."""
    made = [
        b | {"constant": math.ceil(1000 * (b["constant"] + math.log(factor))) / 1000}
        for b, factor in zip((model.lower, model.upper), factors, strict=True)
    ]
    return dataclasses.replace(model, lower=made[0], upper=made[1])


HEAD = """\
| population | flows | holds mu_s / mu_2, % | mu at the ends, % | score | half-width, % |
|---|---|---|---|---|---|"""


def report(rows: Sequence[Row], models: Sequence[ErrorModel]) -> str:
    """A table with a line for each population, each row judged by its model: coverage of the 90 %
    intervals, scores and median half-widths of those of mu_s and mu_2."""
    lines = [HEAD]
    for name in sorted({row.population for row in rows}):
        pairs = zip(rows, models, strict=True)
        lines.append(line_of(name, [judged(r, m) for r, m in pairs if r.population == name]))
    return "\n".join(lines)


def made(rows: Sequence[Row], provenance: str, usual: ErrorModel) -> tuple[ErrorModel, str]:
    """The model of these rows, and its report."""
    data = data_of(rows)
    unseen = left_out(rows, data, usual)
    pulls: dict[str, list[Array]] = {}
    for row, other in zip(rows, unseen, strict=True):
        if not (row.known.real or table.STEPS in row.population):
            pulls.setdefault(row.population, []).append(judged(row, other).pull)
    factors = raised([many for many in pulls.values() if len(many) >= MANY])
    model = with_constants(model_of(most_likely(data), rows, provenance, usual), factors)
    unseen = [with_constants(other, factors) for other in unseen]
    text = f"""\
Each population judged by the model of the families other than its own:

{report(rows, unseen)}

All errors are {factors[0]:.2f} and {factors[1]:.2f} times the fitted ones.
"""
    return model, text


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--csv", type=Path, default=table.PATH, help="the table of table.py")
    parser.add_argument(
        "--write", action="store_true", help="write the shipped model and its report"
    )
    own = parser.parse_args(arguments)
    rows = table.read(own.csv)
    many = len([row for row in rows if row.population != GRAINS])
    note = f"bench.studies.coverage.fit of {many} simulated flows and {len(rows) - many} of grains"
    model, text = made(rows, note, error_model.load())
    print(text)
    content = json.dumps(dataclasses.asdict(model), indent=1)
    print(content)
    if own.write:
        error_model.PATH.write_text(content + "\n", encoding="utf-8")
        REPORT.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
