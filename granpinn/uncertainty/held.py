r"""Errors of (mu_s, mu_2) from data that hold other inertial numbers than the table's, or noise.

Data determine the friction over the range of I that they hold. With x = I/(I + I0), the law is a
line, mu = mu_s (1 - x) + mu_2 x, and mu_s and mu_2 continue it to x = 0 and x = 1. So errors pass
from one flow to another as relative errors f of mu at the ends of the range, f = T z, with

$$ T_{k\cdot} = \frac{\mu_s}{\mu(x_k)} (1 - x_k, x_k). $$

A flow that reaches smaller I has a shorter line, and larger errors f at its upper end
(`ReachError`). Noise adds errors in proportion to a power of $\nu = \sigma \sqrt{N_0 / N}$, with
the noise $\sigma$ over the rms velocity and N independent vectors (`NoiseError`). Both are measured
on collapses of random shape, grains and sampling (bench/studies/coverage).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float64

Pair = tuple[float, float]

LEAST_RANGE = 1e-6  # of x, where a flow has one I alone


@dataclass(frozen=True)
class ReachError:
    """How the errors of mu grow in flows that reach smaller I than those of the table.

    Attributes:
        x: I/(I + I0) at the ends of the range of I, median of the flows of the table.
        size: factor on the errors at both ends in flows of any shape.
        power: the error at either end grows as a power of x[1] over that of the flow.
        flows: number of flows behind it.
        provenance: the trainings that gave the numbers.
    """

    x: tuple[float, float]
    size: tuple[float, float]
    power: tuple[float, float]
    flows: int
    provenance: str

    def __post_init__(self) -> None:
        if not 0 <= self.x[0] < self.x[1] < 1:
            raise ValueError(f"x must ascend within 0 to 1, got {self.x}")


@dataclass(frozen=True)
class NoiseError:
    """The errors of mu that noise of the velocity adds.

    Attributes:
        size: rms relative error of mu at the ends of the range of I with noise of 100 % of the rms
            velocity and this number of vectors; it holds what the widening of the table lacks.
        power: of the noise, to which they are proportional.
        correlation: of the errors at both ends.
        vectors: number of independent vectors.
        flows: number of flows behind it.
        provenance: the trainings that gave the numbers.
    """

    size: tuple[float, float]
    power: tuple[float, float]
    correlation: float
    vectors: float
    flows: int
    provenance: str

    def __post_init__(self) -> None:
        if not (min(*self.size, *self.power, self.vectors) > 0 and abs(self.correlation) < 1):
            raise ValueError("size, power and vectors must be positive, |correlation| below 1")


class Held(NamedTuple):
    """What the data of a flow hold.

    Attributes:
        x: I/(I + I0) at the 5th and the 95th percentile of I over the points that shear.
        noise: rms of that of the vectors, relative to their rms; 0: none.
        vectors: number of independent ones.
    """

    x: Pair
    noise: float = 0.0
    vectors: float = 1.0


def ends_of(I_range: Pair, I0: float) -> Pair:
    """x = I/(I + I0) at both ends of a range of I, at least `LEAST_RANGE` apart."""
    low, high = (I / (I + I0) for I in I_range)  # noqa: E741
    return low, max(high, low + LEAST_RANGE)


def line(x: Pair) -> Float64:
    """mu at the ends by (mu_s, mu_2) [2, 2]."""
    ends = np.array(x)
    return np.stack([1 - ends, ends], axis=1)


def relative(x: Pair, mu: Pair) -> Float64:
    """T [2, 2]: relative errors of mu at the ends by z."""
    J = line(x)
    return np.asarray(J * (mu[0] / (J @ np.array(mu)))[:, None])


def carried(D: Float64, mu: Pair, x: Pair, reach: ReachError, structure: float = 1.0) -> Float64:
    """The second moment D [2, 2] of z in flows of the table, for a flow with other ends x.

    Args:
        structure: further factor on the errors at the lower end (misfit_growth.py).
    """
    growth = np.array(reach.size) * max(1.0, reach.x[1] / x[1]) ** np.array(reach.power)
    growth[0] *= structure
    M = np.linalg.solve(relative(x, mu), growth[:, None] * relative(reach.x, mu))
    return np.asarray(M @ D @ M.T)


def by_noise(mu: Pair, held: Held, error: NoiseError) -> Float64:
    """The second moment [2, 2] of z that noise adds."""
    share = held.noise * math.sqrt(error.vectors / max(1.0, held.vectors))
    size = np.array(error.size) * share ** np.array(error.power)
    F = np.outer(size, size) * np.array([[1.0, error.correlation], [error.correlation, 1.0]])
    back = np.linalg.inv(relative(held.x, mu))
    return np.asarray(back @ F @ back.T)
