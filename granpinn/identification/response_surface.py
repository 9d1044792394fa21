r"""A quadratic surface through runs at some places, and where it comes closest to data.

The values of n points at K places x_k, v_k, are taken for a quadratic in x by least squares. It is
linear in them: at x it is a mean with weights, of which some are negative,

$$ v(x) = \sum_k w_k(x) v_k, \quad \sum_k w_k = 1, \quad w(x) = P^T z(x), $$

with z(x) the terms 1, x_i, x_i x_j and P the pseudo-inverse of those of the places. So the points
are needed in one K x K matrix only, the products of the misfits, however many they are:

$$ |d - v(x)|^2 = w^T S w, \quad S_{kl} = (v_k - d) \cdot (v_l - d). $$
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Place = tuple[int, ...]

REACH = 2.0  # distances between places from the middle one: the quadratic is not trusted beyond
NEWTON_STEPS = 8


class Nearest(NamedTuple):
    """Where a surface comes closest to the data.

    Attributes:
        x: the place [D].
        misfit: |d - v(x)|^2.
        information: J^T J with J = dv/dx there [D, D].
    """

    x: Array
    misfit: float
    information: Array


def composite(dimension: int) -> list[Place]:
    """Middle, faces and corners of a cube: 9 places of two dimensions (all), 15 of three.

    That is the face-centered central composite design. It leaves out the 12 edges of three
    dimensions and finds a law about as well as all 27 places do (docs/method.md, section 5).
    """
    places = product((-1, 0, 1), repeat=dimension)
    return [place for place in places if sum(map(abs, place)) in (0, 1, dimension)]


class Surface:
    """The quadratic over places x_k [K, D], as weights of their values."""

    def __init__(self, places: Sequence[Place]) -> None:
        x = np.array(places, float)
        self.dimension = x.shape[1]
        self._pairs = [*combinations_with_replacement(range(self.dimension), 2)]
        self._of_terms = np.linalg.pinv(np.stack([self._terms(place) for place in x])).T

    def _terms(self, x: Array) -> Array:
        return np.array([1.0, *x, *(x[i] * x[j] for i, j in self._pairs)])

    def weights(self, x: Array) -> Array:
        """Of the values at the places, for the value at x [K]."""
        found: Array = self._of_terms @ self._terms(x)
        return found

    def slopes(self, x: Array) -> Array:
        """d weights / dx [K, D]."""
        one = np.eye(self.dimension)
        products = [one[i] * x[j] + x[i] * one[j] for i, j in self._pairs]
        found: Array = self._of_terms @ np.stack([np.zeros(self.dimension), *one, *products])
        return found

    def nearest(self, S: Array) -> Nearest:
        """Where the misfit is least within REACH, by Gauss-Newton from the middle.

        A coordinate at REACH stays there while the misfit falls outwards.

        Args:
            S: products of the misfits at the places [K, K].
        """
        x = np.zeros(self.dimension)
        for _ in range(NEWTON_STEPS):
            w, dw = self.weights(x), self.slopes(x)
            falls = -dw.T @ S @ w
            free = (np.abs(x) < REACH) | (falls * x < 0)
            information = dw.T @ S @ dw
            x[free] += np.linalg.lstsq(information[np.ix_(free, free)], falls[free], rcond=None)[0]
            x = np.clip(x, -REACH, REACH)
        w, dw = self.weights(x), self.slopes(x)
        return Nearest(x, float(w @ S @ w), dw.T @ S @ dw)
