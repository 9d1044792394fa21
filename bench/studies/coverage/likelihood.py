"""The likelihood of errors of log mu at both ends of the range of I, by the error model.

They have Student's distribution with FREEDOM degrees of freedom, the covariance of the error model,
and for grains their departure from mu(I) beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import optimize, special

from bench.studies.coverage.table import Row
from granpinn.uncertainty.error_model import (
    COEFFICIENTS,
    FEATURES,
    feature,
    line,
    outline,
    quantities,
)

Array = npt.NDArray[np.float64]

FREEDOM = 8.0
PRIOR = 1.0  # sd of the coefficients
START = np.log(0.005)
DEPARTURE, SPREAD = np.log(0.02), 1.0  # of grains: center and sd of the logarithm of level and tilt


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
    return [
        1.0,
        outline(known),
        *(feature(name, values[name], end) for name in FEATURES),
    ]


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


def most_likely(data: Data) -> Array:
    """The coefficients at both ends, the correlation and the departure of grains: 2 C + 3."""
    C = len(COEFFICIENTS)
    signs = ((0, None) if s > 0 else (None, 0) for s in FEATURES.values())
    ends = [(None, None), (0, None), *signs]
    bounds = [*ends, *ends, (-2, 2), (None, None), (None, None)]
    start = np.zeros(2 * C + 3)
    start[[0, C]], start[-2:] = START, DEPARTURE
    options = {"maxiter": 2000, "maxfun": 10**6}
    found = optimize.minimize(unlikely, start, (data,), "L-BFGS-B", bounds=bounds, options=options)
    return np.asarray(found.x)
