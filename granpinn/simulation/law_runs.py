"""Runs of the simulator at the nodes of a lattice of mu(I) laws, at the points of measured data.

A law is a place on the axes q = (log mu_s, log k, log I0) with the slope k = (mu_2 - mu_s)/I0 of
the law at small I. Where I << I0 the data determine k and not I0, so these axes separate well known
from badly known parameters. I0 is relative to the given one. With I0 held there are two unknowns,
q = (log mu_s, log(mu_2 - mu_s)), and their nodes are also nodes of the lattice of three unknowns.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import replace
from threading import Event, Lock

import numpy as np

from granpinn.arrays import Float32, Float64, Int64
from granpinn.data import Flow
from granpinn.physics.laws import mu_of_i
from granpinn.simulation.engine import StepReport
from granpinn.simulation.likeness import (
    GrainColumn,
    Nodes,
    cells_of,
    collapse_of,
    interpolation,
)
from granpinn.simulation.parameters import Collapse
from granpinn.simulation.run import Listener, states

Theta = tuple[float, float, float]  # mu_s, mu_2, I0
Node = tuple[int, ...]

SPACING = np.array([0.0075, 0.0375, 0.075])  # of the lattice, in q
COARSE_CELLS = 256  # largest number across the box in the first stage of a search
MOST_POINTS = 1 << 20  # 8 MB for every run


def velocity_at(
    collapse: Collapse, flow: Flow, points: Int64, listener: Listener | None = None
) -> Float32:
    """The velocity of a simulation at points of a flow [2, n]; NaN where there are no grains.

    Args:
        points: flat indices into [T, Y, X], in increasing order.
    """
    scene, area = collapse.resolved(), flow.c[0].size
    s, h = scene.stride, scene.spacing
    ends = np.searchsorted(points, area * np.arange(len(flow.t) + 1))
    taken = []
    for k, (_, state) in enumerate(states(scene, flow.t.tolist(), listener)):
        empty = state.c[::s, ::s] != 1
        y, x = (0.5 * h + s * h * np.arange(n, dtype=np.float64) for n in empty.shape)
        at = interpolation(Nodes(y, x), flow)
        here = points[ends[k] : ends[k + 1]] - area * k
        fields = (np.where(empty, np.nan, f[::s, ::s]) for f in (state.u_center, state.v_center))
        taken.append(np.stack([at(f).ravel()[here] for f in fields]).astype(np.float32))
    return np.concatenate(taken, axis=1)


class LawRuns:
    """Runs at nodes of the lattice, at the points of a flow; each is made once.

    Attributes:
        stages: (cells across the box, number of unknowns) of the searches, in their order.
        points: flat indices into [T, Y, X], [n].
    """

    def __init__(
        self,
        flow: Flow,
        column: GrainColumn,
        I0: float,
        cells: int | None = None,
        free_I0: bool = False,
        wall_friction: float | None = None,
    ) -> None:
        """The runs have no law yet.

        Args:
            I0: held, or a first guess where it is free.
            cells: across the box, by default those of the data.
            wall_friction: of side walls, if the flow states their distance.
        """
        self.wall_friction = wall_friction
        self.flow, self.column, self.I0 = flow, column, I0
        finest = cells or cells_of(flow, column)
        coarse, unknowns = min(finest, COARSE_CELLS), 3 if free_I0 else 2
        # mu_s and mu_2 are nearly the same on a coarse grid, but its errors shift I0 too far.
        self.stages = [*dict.fromkeys([(coarse, 2), (finest, unknowns)])]
        there = np.flatnonzero(flow.valid & (flow.t > 0)[:, None, None])
        if len(there) > MOST_POINTS:
            kept = np.random.default_rng(0).choice(len(there), MOST_POINTS, replace=False)
            there = there[np.sort(kept)]
        self.points = there
        self._cores = len(os.sched_getaffinity(0))
        self._pool, self._lock = ThreadPoolExecutor(self._cores), Lock()
        self._stopped = Event()
        self._found: dict[tuple[int, Node], Future[Float32]] = {}

    @property
    def made(self) -> int:
        return len(self._found)

    def law_at(self, q: Float64) -> Theta:
        """(mu_s, mu_2, I0) at q, of two or three unknowns."""
        mu_s, rise, ratio = np.exp([*q, 0.0][:3]).tolist()
        return mu_s, mu_s + rise * ratio, ratio * self.I0

    def law_by_q(self, q: Float64) -> Float64:
        """d(mu_s, mu_2, I0)/dq [3, unknowns]."""
        mu_s, mu_2, I0 = self.law_at(q)
        rise = mu_2 - mu_s
        return np.array([[mu_s, 0, 0], [mu_s, rise, rise], [0, 0, I0]])[:, : len(q)]

    def velocities(self, cells: int, nodes: Sequence[Node]) -> list[Float32]:
        """The velocity at the points for the law of every node, [2, n] each; NaN: no grains.

        Fits in several threads share the runs: each node is run once.

        Args:
            nodes: indices on the lattice; with two of them, I0 is the given one.
        """
        nodes = [(*node, 0)[:3] for node in nodes]
        with self._lock:
            missing = [node for node in nodes if (cells, node) not in self._found]
            waiting = len(missing) + sum(not run.done() for run in self._found.values())
            for node in missing:
                theta = self.law_at(np.array(node) * SPACING)
                collapse = collapse_of(
                    self.flow, self.column, mu_of_i.LAW, theta, cells, self.wall_friction
                )
                threads = max(1, self._cores // waiting)
                run = self._pool.submit(self._run, replace(collapse, threads=threads))
                self._found[cells, node] = run
        return [self._found[cells, node].result() for node in nodes]

    def stop(self) -> None:
        """End the runs that are left, without waiting for them."""
        self._stopped.set()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _run(self, collapse: Collapse) -> Float32:
        def stop(report: StepReport) -> None:
            if self._stopped.is_set():
                raise CancelledError

        return velocity_at(collapse, self.flow, self.points, stop)
