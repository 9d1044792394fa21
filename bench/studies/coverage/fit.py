"""The error model of granpinn/uncertainty/error_model.json, fitted to results/rows.csv.

python -m bench.studies.coverage.fit --write

Maximum likelihood: the errors of log mu at both ends of the range of I have Student's distribution
with FREEDOM degrees of freedom, the covariance of the error model, and for grains their departure
from mu(I) beside it. Scenes count once, whatever the number of their seeds. Coefficients have a
normal prior of PRIOR, and the sign with which errors grow.

Then every family of populations is left out in turn (`table.ALIKE`, those of one draw of flows, a
number of steps, a scene of grains), and judged by the model of the others. The constants get the
least factors with which the 90 % intervals hold LEAST of the truths of each of these populations.
Those of few flows do not count, nor does a number of steps, which no other population is like.

--write also writes the tables of both to results/report.md. It takes three minutes.
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
import numpy.typing as npt
from scipy import optimize, special

from bench.studies.coverage import table
from bench.studies.coverage.table import GRAINS, Row
from granpinn.uncertainty import error_bars, error_model
from granpinn.uncertainty.error_model import (
    COEFFICIENTS,
    FEATURES,
    WORDS,
    ErrorModel,
    feature,
    line,
    outline,
    quantities,
)

Array = npt.NDArray[np.float64]

REPORT = table.PATH.with_name("report.md")
FREEDOM = 8.0
PRIOR = 1.0  # sd of the coefficients
START = np.log(0.005)
DEPARTURE, SPREAD = np.log(0.02), 1.0  # of grains: center and sd of the logarithm of level and tilt
LEAST, MANY = 0.85, 40
SHARE = 0.9
MISS = 2 / (1 - SHARE)  # of the interval score: cost of a miss
NORMAL = 1.645  # half of the central 90 % of a normal distribution, in sd


class Data(NamedTuple):
    """What the likelihood needs of n identifications.

    Attributes:
        features: by `COEFFICIENTS`, at both ends [2, n, C].
        error: of log mu at two places, 0 at the second one where there is one only [n, 2].
        weights: errors at both places by those at both ends [n, 2, 2].
        spread: 1 at the second place where there is none, else 0 [n].
        real: 1 for grains [n].
        share: how much a row counts [n].
    """

    features: Array
    error: Array
    weights: Array
    spread: Array
    real: Array
    share: Array


def data_of(rows: Sequence[Row]) -> Data:
    """The data of the likelihood."""
    features = np.array([[_features(row, end) for row in rows] for end in (0, 1)])
    places = [places_of(row) for row in rows]
    alone = np.array([len(x) == 1 for x in places], float)
    errors = [np.resize(errors_at(r, x), 2) for r, x in zip(rows, places, strict=True)]
    weights = [np.resize(weights_at(r, x), (2, 2)) for r, x in zip(rows, places, strict=True)]
    both = np.stack([np.ones_like(alone), 1 - alone], axis=1)
    names = [(row.population, row.name) for row in rows]
    counts = {name: names.count(name) for name in set(names)}
    return Data(
        features,
        np.array(errors) * both,
        np.array(weights) * both[:, :, None],
        alone,
        np.array([row.known.real for row in rows], float),
        np.array([1 / counts[name] for name in names]),
    )


def _features(row: Row, end: int) -> list[float]:
    known = row.known
    values = quantities(known)
    return [1.0, outline(known), *(feature(name, values[name], end) for name in FEATURES)]


def places_of(row: Row) -> Array:
    """x at the two places of a range of I where the truth is known, or at the one."""
    if row.true_range is None:
        return np.array(row.known.x)
    ends = np.array(row.true_range)
    return np.unique(np.clip(ends / (ends + row.I0), *row.known.x))


def errors_at(row: Row, x: Array) -> Array:
    """Errors of log mu at x [n]."""
    J = np.stack([1 - x, x], axis=1)
    return np.asarray(np.log((J @ np.array(row.known.mu)) / (J @ np.array(row.truth))))


def weights_at(row: Row, x: Array) -> Array:
    """Relative errors of mu at x by those at both ends of the range of I [n, 2]."""
    J = np.stack([1 - x, x], axis=1)
    of_mu = np.linalg.solve(line(row.known.x).T, J.T).T * row.known.ends
    return np.asarray(of_mu / (J @ np.array(row.known.mu))[:, None])


def some(data: Data, chosen: npt.NDArray[np.bool_]) -> Data:
    """Some of the rows [n]."""
    return Data(data.features[:, chosen], *(part[chosen] for part in data[1:]))


def unlikely(p: Array, data: Data) -> float:
    """Minus the logarithm of the posterior density."""
    C = len(COEFFICIENTS)
    s = np.exp(np.einsum("enc,ec->en", data.features, p[: 2 * C].reshape(2, C)))
    level, tilt = np.exp(2 * p[-2:])
    covariance = np.empty((s.shape[1], 2, 2))
    for i in range(2):
        for j in range(2):
            departure = data.real * (level + (tilt if i == j else -tilt))
            covariance[:, i, j] = s[i] * s[j] * (1 if i == j else np.tanh(p[2 * C])) + departure
    covariance = data.weights @ covariance @ data.weights.transpose(0, 2, 1)
    covariance[:, 1, 1] += data.spread
    (a, b), (_, d) = covariance.transpose(1, 2, 0)
    determinant = a * d - b * b
    e, f = data.error.T
    distance = (d * e * e - 2 * b * e * f + a * f * f) / determinant
    places = 2 - data.spread
    density = special.gammaln((FREEDOM + places) / 2) - places / 2 * np.log(FREEDOM * np.pi)
    density -= (FREEDOM + places) / 2 * np.log1p(distance / FREEDOM) + np.log(determinant) / 2
    prior = np.delete(p[: 2 * C], (0, C)) / PRIOR
    of_grains = (p[-2:] - DEPARTURE) / SPREAD
    return float(-data.share @ density + prior @ prior / 2 + of_grains @ of_grains / 2)


def fit(data: Data) -> Array:
    """The coefficients at both ends, the correlation and the departure of grains: 2 C + 3."""
    C = len(COEFFICIENTS)
    ends = [
        (None, None),
        (0, None),
        *((0, None) if s > 0 else (None, 0) for s in FEATURES.values()),
    ]
    bounds = [*ends, *ends, (-2, 2), (None, None), (None, None)]
    start = np.zeros(2 * C + 3)
    start[[0, C]], start[-2:] = START, DEPARTURE
    options = {"maxiter": 2000, "maxfun": 10**6}
    found = optimize.minimize(unlikely, start, (data,), "L-BFGS-B", bounds=bounds, options=options)
    return np.asarray(found.x)


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
    low, high = np.array([found[name].interval_90 for name in error_bars.NAMES]).T
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
        of_family[family] = model_of(fit(some(data, others)), known, "", usual)
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
    model = with_constants(model_of(fit(data), rows, provenance, usual), factors)
    unseen = [with_constants(other, factors) for other in unseen]
    text = f"""\
Each population judged by the model of the families other than its own:

{report(rows, unseen)}

By the model of all, whose errors are {factors[0]:.2f} and {factors[1]:.2f} times the fitted ones:

{report(rows, [model] * len(rows))}
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
