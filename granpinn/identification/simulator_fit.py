r"""The law by which the simulator comes closest to the measured velocity.

A second opinion that shares nothing with the network: it knows the initial column, the walls and
the equations of the whole box, and where the data come from such a box it uses noisy ones better
(docs/method.md, section 5). Where shear bands decide (mu_s of 0.6), or the walls are others, it is
the one that errs.

The simulated velocity is taken as a quadratic function of q = (log mu_s, log(mu_2 - mu_s)) at every
point, fitted to runs at nine nodes of a lattice around the start:

$$ v(q) = a + b \cdot q + q \cdot C q, \qquad \sum |v_{data} - v(q)|^2 \to \min. $$

Differences of single runs hold what bands and rounding do; over nine runs that averages out. Where
the least misfit lies beyond the nodes, they move there, and apart where it is far away.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product

import numpy as np
import numpy.typing as npt

from granpinn.data import Flow
from granpinn.identification.comparison import interpolation
from granpinn.identification.resimulation import Column, cells_of, collapse_of
from granpinn.results.findings import SimulatorFit
from granpinn.simulation import Collapse
from granpinn.simulation.progress import Silent
from granpinn.simulation.recorder import Recorder
from granpinn.simulation.run import record

Array = npt.NDArray[np.float64]
Node = tuple[int, int]

CELLS = 256  # across the box, at most
SPACING = np.array([0.03, 0.15])  # of the lattice, in q
ROUNDS = 10  # of nine nodes, at most
REACH = 2.0  # distances between nodes from the middle one: the quadratic is not trusted beyond
WIDEST = 4  # spacings between two nodes, at most
NEWTON_STEPS = 8
MOST_POINTS = 100_000
PLACES = [*product((-1, 0, 1), repeat=2)]


def law_at(q: Array) -> tuple[float, float]:
    """(mu_s, mu_2) at q."""
    return math.exp(q[0]), math.exp(q[0]) + math.exp(q[1])


def run_all(collapses: Sequence[Collapse], times: Sequence[float]) -> list[Flow]:
    """Simulate side by side on all cores."""
    cores = len(os.sched_getaffinity(0))
    threads = max(1, cores // len(collapses))

    def one(collapse: Collapse) -> Flow:
        recorder = Recorder(replace(collapse, threads=threads))
        record(recorder, Silent(), times)
        return recorder.flow()

    with ThreadPoolExecutor(min(cores, len(collapses))) as pool:
        return list(pool.map(one, collapses))


def at_data(simulated: Flow, flow: Flow) -> Array:
    """The simulated velocity at the points of the data [2, T, Y, X]; NaN where there is none."""
    at = interpolation(simulated, flow)
    return np.stack([[at(frame) for frame in field] for field in (simulated.u, simulated.v)])


class Simulations:
    """Runs at the nodes of the lattice, at the points of a flow; each is made once."""

    def __init__(self, flow: Flow, column: Column, I0: float, cells: int | None = None) -> None:
        """`cells`: across the box, by default those of the data and at most `CELLS`."""
        self.flow, self.column, self.I0 = flow, column, I0
        self.cells = cells or min(cells_of(flow, column), CELLS)
        there = np.flatnonzero(flow.valid & (flow.t > 0)[:, None, None])
        if len(there) > MOST_POINTS:
            kept = np.random.default_rng(0).choice(len(there), MOST_POINTS, replace=False)
            there = there[np.sort(kept)]
        self.points = there
        self._found: dict[Node, Array] = {}

    @property
    def runs(self) -> int:
        return len(self._found)

    def velocities(self, nodes: Sequence[Node]) -> Array:
        """The velocity at the points of every node, [nodes, 2, points]."""
        missing = [node for node in nodes if node not in self._found]
        if missing:
            collapses = [
                collapse_of(
                    self.flow, self.column, (*law_at(np.array(node) * SPACING), self.I0), self.cells
                )
                for node in missing
            ]
            for node, run in zip(missing, run_all(collapses, self.flow.t.tolist()), strict=True):
                v = at_data(run, self.flow)
                self._found[node] = v.reshape(2, -1)[:, self.points]
        return np.stack([self._found[node] for node in nodes])


def fit(flow: Flow, simulations: Simulations, start: tuple[float, float]) -> SimulatorFit:
    """The law of the least misfit, from a start.

    Args:
        flow: the data on the points of the simulations, with their noise.
        start: (mu_s, mu_2).

    Raises:
        SimulationError: a solve did not converge.
    """
    begin = time.monotonic()
    data = np.stack([flow.u, flow.v]).reshape(2, -1)[:, simulations.points].astype(np.float64)
    q = np.log([start[0], start[1] - start[0]])
    wide = 1
    for _ in range(ROUNDS):
        middle = np.round(q / SPACING).astype(int)
        nodes = [(int(middle[0]) + wide * i, int(middle[1]) + wide * j) for i, j in PLACES]
        v = simulations.velocities(nodes)
        common = np.isfinite(v).all(axis=(0, 1)) & np.isfinite(data).all(axis=0)
        target = data[:, common].ravel()
        offset, J, misfit = _least(v[:, :, common].reshape(len(nodes), -1), target)
        q = (middle + wide * offset) * SPACING
        far = float(np.abs(offset).max())
        inside = wide == 1 and far <= 1
        if inside:
            break
        wide = min(2 * wide, WIDEST) if far >= REACH else 1 if far <= 1 else wide
    variance = float(misfit @ misfit) / max(1, len(misfit) - 2)
    covariance = variance * np.linalg.inv(J.T @ J) * np.outer(wide * SPACING, wide * SPACING)
    mu_s, mu_2 = law_at(q)
    to_law = np.array([[mu_s, 0.0], [mu_s, mu_2 - mu_s]])
    std = np.sqrt(np.diag(to_law @ covariance @ to_law.T))
    return SimulatorFit(
        mu_s=mu_s,
        mu_2=mu_2,
        std=(float(std[0]), float(std[1])),
        misfit_percent=100 * float(np.linalg.norm(misfit) / np.linalg.norm(target)),
        common_percent=100 * float(common.mean()),
        inside=inside,
        cells=simulations.cells,
        runs=simulations.runs,
        seconds=time.monotonic() - begin,
    )


def _least(values: Array, target: Array) -> tuple[Array, Array, Array]:
    """Offset from the middle node with the least misfit, J = dv/d offset there, and the misfit.

    Args:
        values: at the nine nodes [9, n]; target: [n].
    """
    i, j = np.array(PLACES, float).T
    terms = np.stack([np.ones(9), i, j, i * i, i * j, j * j], axis=1)
    a = np.linalg.lstsq(terms, values, rcond=None)[0]
    x = np.zeros(2)
    for k in range(NEWTON_STEPS + 1):
        J = np.stack([a[1] + 2 * x[0] * a[3] + x[1] * a[4], a[2] + x[0] * a[4] + 2 * x[1] * a[5]])
        found = np.array([1, x[0], x[1], x[0] ** 2, x[0] * x[1], x[1] ** 2]) @ a
        misfit = target - found
        if k < NEWTON_STEPS:
            x = np.clip(x + np.linalg.solve(J @ J.T, J @ misfit), -REACH, REACH)
    return x, J.T, misfit
