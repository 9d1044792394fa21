r"""The law by which the simulator comes closest to the measured velocity.

A second opinion that shares nothing with the network: it knows the initial column, the walls and
the equations of the whole box, and where the data come from such a box it uses noisy ones better
(docs/method.md, section 5). Where shear bands decide (mu_s of 0.6), or the walls are others, it is
the one that errs.

The simulated velocity is taken as a quadratic function of the law q at every point
(response_surface.py), fitted to runs at the nodes of a lattice around the start (law_runs.py): nine
for mu_s and mu_2, 15 where I0 is free,

$$ v(q) = a + b \cdot q + q \cdot C q, \qquad \sum |v_{data} - v(q)|^2 \to \min. $$

Differences of single runs hold what bands and rounding do; over the nodes that averages out. The
nodes move until the least misfit is nearest to their middle, and apart where it is far away. The
search begins on at most 256 cells across the box and ends on those of the data, with nodes half as
far apart.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from granpinn.data import Flow
from granpinn.identification.law_runs import SPACING, Array32, LawRuns, Node
from granpinn.identification.response_surface import REACH, Surface, composite
from granpinn.results.findings import SimulatorFit

Array = npt.NDArray[np.float64]

ROUNDS = 12  # of all nodes, at most, on each grid
USUAL = 2  # spacings of the lattice between two nodes of a search from afar
WIDEST = 8  # at most
FARTHEST_I0 = 10.0  # times the given one, or a tenth
CHUNK = 1 << 16  # points at a time


class Minimum(NamedTuple):
    """Of the misfit over the laws.

    Attributes:
        q: where it is.
        inside: whether it lies among the nodes.
        covariance: of q, by the scatter of the misfit.
        misfit: of the velocity, relative to its root mean square.
        common: share of the points that all runs and the data have.
    """

    q: Array
    inside: bool
    covariance: Array
    misfit: float
    common: float


def fit(flow: Flow, runs: LawRuns, start: tuple[float, float]) -> SimulatorFit:
    """The law of the least misfit, from a start.

    Args:
        flow: the data on the points of the runs, with their noise.
        start: (mu_s, mu_2), with the I0 of the runs.

    Raises:
        SimulationError: a solve did not converge.
    """
    begin = time.monotonic()
    data = np.stack([flow.u, flow.v]).reshape(2, -1)[:, runs.points]
    mu_s, mu_2 = start
    q = np.log([mu_s, mu_2 - mu_s])
    for cells, unknowns in runs.stages:
        last = (cells, unknowns) == runs.stages[-1]
        q = np.append(q, np.zeros(unknowns - len(q)))
        found = search(data, runs, cells, q, wide=1 if last else USUAL)
        q = found.q
    free = len(q) == 3
    mu_s, mu_2, I0 = runs.law_at(q)
    to_law = runs.law_by_q(q)
    covariance = to_law @ found.covariance @ to_law.T
    std = np.sqrt(np.diag(covariance)).tolist()
    return SimulatorFit(
        mu_s=mu_s,
        mu_2=mu_2,
        std=(std[0], std[1]),
        misfit_percent=100 * found.misfit,
        common_percent=100 * found.common,
        inside=found.inside,
        cells=cells,
        runs=runs.made,
        seconds=time.monotonic() - begin,
        I0=I0 if free else None,
        I0_std=std[2] if free else None,
        correlation=float(covariance[1, 2]) / (std[1] * std[2]) if free else None,
    )


def search(data: Array32, runs: LawRuns, cells: int, q: Array, wide: int) -> Minimum:
    """The least misfit to data [2, n] on one grid, from q; at first with nodes so wide apart."""
    places = composite(len(q))
    surface, unit = Surface(places), SPACING[: len(q)]
    seen: set[tuple[Node, int]] = set()
    while len(seen) < ROUNDS:
        spacing = wide * unit
        middle = wide * np.round(q / spacing).astype(int)
        nodes = [tuple((middle + wide * np.array(place)).tolist()) for place in places]
        if (nodes[0], wide) in seen:
            break
        seen.add((nodes[0], wide))
        S, energy, common = products(runs.velocities(cells, nodes), data)
        nearest = surface.nearest(S)
        taken = spacing
        q = middle * unit + nearest.x * spacing
        q[2:] = np.clip(q[2:], -math.log(FARTHEST_I0), math.log(FARTHEST_I0))
        far = float(np.abs(nearest.x).max())
        limited = bool((np.abs(q[2:]) >= math.log(FARTHEST_I0)).any())
        inside = wide <= USUAL and far <= 1 and not limited
        if far >= REACH:
            wide = min(2 * wide, WIDEST)
        elif far <= 1:
            wide = min(wide, USUAL)
    values = 2 * round(common * data.shape[1])
    variance = nearest.misfit / max(1, values - len(q))
    covariance = variance * np.linalg.pinv(nearest.information)
    covariance *= np.outer(taken, taken)
    return Minimum(q, inside, covariance, (nearest.misfit / energy) ** 0.5, common)


def products(values: Sequence[Array32], data: Array32) -> tuple[Array, float, float]:
    """S_kl = (v_k - d) (v_l - d), d d, and the share of the points where none is NaN."""
    K, n = len(values), data.shape[1]
    S, energy, common = np.zeros((K, K)), 0.0, 0
    for part in (slice(k, k + CHUNK) for k in range(0, n, CHUNK)):
        d, v = data[:, part].astype(np.float64), np.stack([value[:, part] for value in values])
        known = np.isfinite(d).all(axis=0) & np.isfinite(v).all(axis=(0, 1))
        misfits = (v - d)[:, :, known].reshape(K, -1)
        S += misfits @ misfits.T
        energy += float((d[:, known] ** 2).sum())
        common += int(known.sum())
    return S, energy, common / n
