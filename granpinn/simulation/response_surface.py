r"""A quadratic surface through runs at some places, and its point of least misfit to data.

A quadratic in x is fitted by least squares to the values v_k of n points at K places x_k. It is
linear in the values: at x it is a mean with weights, some of them negative,

$$ v(x) = \sum_k w_k(x) v_k, \quad \sum_k w_k = 1, \quad w(x) = P^T z(x), $$

with z(x) the terms 1, x_i, x_i x_j and P the pseudo-inverse of the terms z(x_k). So the n points
enter through one K x K matrix only, the products of the misfits:

$$ |d - v(x)|^2 = w^T S w, \quad S_{kl} = (v_k - d) \cdot (v_l - d). $$

A run is rough: a law that differs by a billionth has other bands, and the velocity differs as much
as between two distant laws. Roughness moves many points at once, unlike noise. The data of such a
run have a roughness of their own. The residuals of the quadratic are samples of it: E = V^T Q. The
K - dim z columns of Q are the combinations of runs that vanish for every quadratic. The covariance
is C = 2 E E^T / (K - dim z), for the data and for the surface together. With noise of variance s^2
the misfit is weighed by the inverse of s^2 + C, again by K x K matrices:

$$ s^2 (d - v)^T (s^2 + C)^{-1} (d - v) = w^T (S - S Q (Q^T S Q + r)^{-1} Q^T S) w,
\quad r = s^2 (K - dim z)/2. $$

Where the noise is larger than the roughness, this changes nothing. Where it is smaller, the
differences between the runs do not count as differences from the data.
"""

from __future__ import annotations

from itertools import combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn.arrays import Float64

Place = tuple[float, ...]

REACH = 2.0  # largest distance from the middle place at which the quadratic is used
NEWTON_STEPS = 8
PASSES = 4
ROUGH_RUNS = 2.0  # one for the roughness of the data, one for the part left in the surface
TINY = 1e-300


class Nearest(NamedTuple):
    """The point of least misfit between a surface and the data.

    Attributes:
        x: the place [D].
        misfit: |d - v(x)|^2.
        covariance: of x [D, D], by the scatter of the misfit and the roughness.
        roughness: the largest variance of the roughness in any direction, relative to the noise's.
    """

    x: Float64
    misfit: float
    covariance: Float64
    roughness: float


def composite(dimension: int) -> list[Place]:
    """Middle, faces and corners of a cube: 9 places of two dimensions (all), 15 of three.

    That is the face-centered central composite design, without the 12 edges of three dimensions.
    """
    places = product((0, -1, 1), repeat=dimension)
    return [place for place in places if sum(map(abs, place)) in (0, 1, dimension)]


def filled(dimension: int) -> list[Place]:
    """The composite places, and the cube of half the size: 17 places, 41 of three dimensions."""
    inner = product((0, -0.5, 0.5), repeat=dimension)
    return list(dict.fromkeys([*composite(dimension), *inner]))


class ResponseSurface:
    """The quadratic over places x_k [K, D], as weights of their values."""

    def __init__(self, places: npt.ArrayLike) -> None:
        x = np.asarray(places, float)
        self.dimension = x.shape[1]
        self._pairs = [*combinations_with_replacement(range(self.dimension), 2)]
        terms = np.stack([self._terms(place) for place in x])
        self._of_terms = np.linalg.pinv(terms).T
        self._left = np.linalg.svd(terms)[0][:, terms.shape[1] :]  # Q

    def _terms(self, x: Float64) -> Float64:
        return np.array([1.0, *x, *(x[i] * x[j] for i, j in self._pairs)])

    def weights(self, x: Float64) -> Float64:
        """Of the values at the places, for the value at x [K]."""
        found: Float64 = self._of_terms @ self._terms(x)
        return found

    def slopes(self, x: Float64) -> Float64:
        """d weights / dx [K, D]."""
        one = np.eye(self.dimension)
        products = [one[i] * x[j] + x[i] * one[j] for i, j in self._pairs]
        found: Float64 = self._of_terms @ np.stack([np.zeros(self.dimension), *one, *products])
        return found

    def nearest(self, S: Float64, values: float) -> Nearest:
        """Where the misfit is least within REACH, with the roughness and the noise weighed.

        Args:
            S: products of the misfits at the places [K, K].
            values: number of values that S sums over.
        """
        x = self._least(S, np.zeros(self.dimension))
        variance = self._misfit(S, x) / max(1.0, values - self.dimension)
        smooth = S
        for _ in range(PASSES):  # the variance without the roughness is the variance of the noise
            smooth = self.without_roughness(S, variance)
            x = self._least(smooth, x)
            variance = self._misfit(smooth, x) / max(1.0, values - self.dimension)
        dw, Q = self.slopes(x), self._left
        covariance = variance * np.linalg.pinv(dw.T @ smooth @ dw)
        largest = float(np.linalg.eigvalsh(Q.T @ S @ Q).max()) / Q.shape[1]
        return Nearest(x, self._misfit(S, x), covariance, largest / max(variance, TINY))

    def without_roughness(self, S: Float64, variance: float) -> Float64:
        """Products of the misfits with noise and roughness weighed, S - S Q (...)^-1 Q^T S [K, K].

        Args:
            S: products of the misfits [K, K].
            variance: of the noise of a value.
        """
        Q = self._left
        SQ, noise = S @ Q, variance * Q.shape[1] / ROUGH_RUNS * np.eye(Q.shape[1])
        found: Float64 = S - SQ @ np.linalg.pinv(Q.T @ SQ + noise) @ SQ.T
        return found

    def _misfit(self, S: Float64, x: Float64) -> float:
        w = self.weights(x)
        return float(w @ S @ w)

    def _least(self, S: Float64, x: Float64) -> Float64:
        """By Gauss-Newton from x; a coordinate at REACH stays there while S falls outwards."""
        for _ in range(NEWTON_STEPS):
            w, dw = self.weights(x), self.slopes(x)
            falls = -dw.T @ S @ w
            free = (np.abs(x) < REACH) | (falls * x < 0)
            information = dw.T @ S @ dw
            x = x.copy()
            x[free] += np.linalg.lstsq(information[np.ix_(free, free)], falls[free], rcond=None)[0]
            x = np.clip(x, -REACH, REACH)
        return x
