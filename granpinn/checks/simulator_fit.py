r"""The mu(I) law whose simulation is closest to the measured velocity.

This fit does not use the network. It uses the initial column, the walls and the equations of the
whole box. For data of such a box it is more exact with noisy vectors (bench/studies/simulator_fit).
It errs if shear bands dominate (mu_s of 0.6) or the walls differ.

For mu(I) alone: the lattice (law_runs.py) is made for its parameters.

The simulated velocity is taken as a quadratic function of the law q at every point
(response_surface.py), fitted to runs at the nodes of a lattice around the start (law_runs.py): nine
for mu_s and mu_2, 15 where I0 is free,

$$ v(q) = a + b \cdot q + q \cdot C q, \qquad \sum |v_{data} - v(q)|^2 \to \min. $$

The nodes move until the least misfit is nearest to their middle. The distance of two nodes is at
least the standard deviation of each unknown, so that noise keeps the minimum among them. It is also
at least SPACING, below which the quadratic is no better. The search begins on at most 256 cells
across the box, with nodes twice as far apart, and ends on the cells of the data.

A run is rough: a law that differs by a billionth has other bands and splashes. If this roughness
exceeds the noise, more nodes are added in the end, half as far apart (17, or 41). They measure the
roughness, which then does not count as a misfit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from granpinn.arrays import Float32, Float64, Int64
from granpinn.data import Flow, add_noise
from granpinn.data.steady import steady_mean
from granpinn.data.symmetry import with_layer
from granpinn.fit.context import Context
from granpinn.physics.laws import mu_of_i
from granpinn.results.record import Check, Record
from granpinn.simulation.law_runs import SPACING, LawRuns, Node
from granpinn.simulation.likeness import GrainColumn, initial_column
from granpinn.simulation.response_surface import (
    REACH,
    Place,
    ResponseSurface,
    composite,
    filled,
)

ROUNDS = 12  # of all nodes, at most, on each grid
# Spacings of the lattice between two nodes, powers of two:
NARROWEST = 2  # the least in the last search; twice as many in the first one
WIDEST = 16
DEVIATIONS = 1.0  # least distance between nodes, in standard deviations of an unknown
ROUGH = 1.0  # roughness above which nodes are added, relative to the variance of the noise
FARTHEST_I0 = 10.0  # largest factor between I0 and the given one
CHUNK = 1 << 14  # points at a time


@dataclass(frozen=True)
class SimulatorFit(Record):
    """The mu(I) law whose simulation is closest to the data .

    Attributes:
        mu_s, mu_2: at the least misfit.
        std: of both, by noise and the roughness of runs, without the error of the simulator.
        misfit_percent: of the velocity, relative to its root mean square.
        common_percent: share of the points that all simulations have.
        inside: whether the least misfit lies among the laws that were simulated.
        cells: across the box, in the last simulations; runs: number of all simulations.
        I0, I0_std, correlation: where I0 was fitted too, and its correlation with mu_2; else None.
    """

    title = "Fit of the simulator"
    notes = (
        "This fit shares nothing with the network. It takes column, walls and box as known; +- is "
        "the effect of the noise of the data. Where column, walls and box are right, it makes "
        "better use of noisy data. Errors of the simulator or of the walls enter it in full, and "
        "so do shear bands at high friction. Where the two laws differ by more than both their "
        "errors, one of these assumptions does not hold."
    )

    mu_s: float
    mu_2: float
    std: tuple[float, float]
    misfit_percent: float
    common_percent: float
    inside: bool
    cells: int
    runs: int
    seconds: float
    I0: float | None = None
    I0_std: float | None = None
    correlation: float | None = None

    @property
    def words(self) -> str:
        doubt = "" if self.inside else "; NOT a minimum: it lies outside of the simulated laws"
        third = "" if self.I0 is None else f", I0 {self.I0:.4f}"
        third_std = "" if self.I0_std is None else f", {self.I0_std:.4f}"
        if self.correlation is not None:
            third_std += f", correlation of mu_2 with I0 {self.correlation:+.2f}"
        return (
            f"fitted by the simulator: mu_s {self.mu_s:.4f}, mu_2 {self.mu_2:.4f}{third} (noise "
            f"and rough runs: +- {self.std[0]:.4f}, {self.std[1]:.4f}{third_std}; {self.runs} "
            f"runs, the last on {self.cells} cells, misfit {self.misfit_percent:.2f} %{doubt})"
        )


class Minimum(NamedTuple):
    """The least misfit over the laws.

    Attributes:
        q: place of the minimum.
        widths: between two nodes along each unknown, in spacings of the lattice.
        x: distance of q from the middle of the nodes, in `widths`.
        limited: whether I0 is at the largest distance from the given one.
        covariance: of q, by the scatter of the misfit and the roughness of the runs.
        misfit: of the velocity, relative to its root mean square.
        common: share of the points that all runs and the data have.
        roughness: of the runs, the variance in its largest direction relative to the noise's.
    """

    q: Float64
    widths: Int64
    x: Float64
    limited: bool
    covariance: Float64
    misfit: float
    common: float
    roughness: float

    @property
    def inside(self) -> bool:
        """Whether the minimum lies among the nodes."""
        return bool(np.abs(self.x).max() <= 1) and not self.limited


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
    q, widths = np.log([mu_s, mu_2 - mu_s]), np.full(2, 2 * NARROWEST)
    for cells, unknowns in runs.stages:
        last = (cells, unknowns) == runs.stages[-1]
        more = unknowns - len(q)
        q, widths = np.append(q, np.zeros(more)), np.append(widths, np.full(more, NARROWEST))
        found = search(data, runs, cells, q, widths, last)
        q, widths = found.q, found.widths
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


def search(
    data: Float32, runs: LawRuns, cells: int, q: Float64, widths: Int64, last: bool
) -> Minimum:
    """The least misfit to data [2, n] on one grid; the first nodes are `widths` apart around q."""
    least = np.full(len(q), NARROWEST if last else 2 * NARROWEST)
    found = settle(data, runs, cells, q, widths, least, composite(len(q)))
    if not last or found.roughness <= ROUGH:
        return found
    return settle(data, runs, cells, found.q, found.widths, found.widths, filled(len(q)))


def settle(
    data: Float32,
    runs: LawRuns,
    cells: int,
    q: Float64,
    widths: Int64,
    least: Int64,
    places: Sequence[Place],
) -> Minimum:
    """Move the nodes and change their distances until they repeat, for at most ROUNDS rounds."""
    seen: set[tuple[Node, Node]] = set()
    nodes = around(q, widths, places)
    while True:
        seen.add((nodes[0], tuple(widths.tolist())))
        found = closest(data, runs, cells, nodes, widths)
        if found.inside:
            std = np.sqrt(np.diag(found.covariance))
            widths = asked_for(std / SPACING[: len(std)], least)
        else:
            widths = np.where(np.abs(found.x) >= REACH, np.minimum(2 * widths, WIDEST), widths)
        nodes = around(found.q, widths, places)
        if (nodes[0], tuple(widths.tolist())) in seen and not found.inside:
            least = widths = np.minimum(2 * widths, WIDEST)  # the nodes repeat in a cycle
            nodes = around(found.q, widths, places)
        if (nodes[0], tuple(widths.tolist())) in seen or len(seen) == ROUNDS:
            return found


def around(q: Float64, widths: Int64, places: Sequence[Place]) -> list[Node]:
    """The nodes at the places around the one next to q, the middle one first."""
    middle = widths * np.round(q / (widths * SPACING[: len(q)]))
    return [tuple((middle + widths * np.array(x)).astype(int).tolist()) for x in places]


def closest(
    data: Float32, runs: LawRuns, cells: int, nodes: Sequence[Node], widths: Int64
) -> Minimum:
    """The least misfit of the surface through the nodes; the first node is the middle one."""
    unit, middle = SPACING[: len(widths)], np.array(nodes[0])
    S, energy, common = products(runs.velocities(cells, nodes), data)
    surface = ResponseSurface((np.array(nodes) - middle) / widths)
    nearest = surface.nearest(S, 2 * common * data.shape[1])
    q = (middle + nearest.x * widths) * unit
    q[2:] = np.clip(q[2:], -math.log(FARTHEST_I0), math.log(FARTHEST_I0))
    return Minimum(
        q=q,
        widths=widths,
        x=nearest.x,
        limited=bool((np.abs(q[2:]) >= math.log(FARTHEST_I0)).any()),
        covariance=nearest.covariance * np.outer(widths * unit, widths * unit),
        misfit=(nearest.misfit / energy) ** 0.5,
        common=common,
        roughness=nearest.roughness,
    )


def asked_for(std: Float64, least: Int64) -> Int64:
    """Powers of two of at least DEVIATIONS standard deviations, all in spacings of the lattice."""
    wide = np.clip(DEVIATIONS * std, least, WIDEST)
    return (2 ** np.ceil(np.log2(wide))).astype(int)


def products(values: Sequence[Float32], data: Float32) -> tuple[Float64, float, float]:
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


def make(context: Context) -> SimulatorFit | None:
    """The fit from the identified law; None for other laws than mu(I) and for other scenes."""
    config, flow = context.case.config, steady_mean(with_layer(context.case.flow))
    column = None if flow.periodic else initial_column(flow)
    if context.result.law.name != mu_of_i.LAW.name or not isinstance(column, GrainColumn):
        return None
    seen = add_noise(context.case.flow, config.noise, config.seed)
    mu_s, mu_2, I0 = context.result.theta
    cells, friction = config.resimulation.cells, config.side_walls.friction
    runs = LawRuns(seen, column, I0, cells, config.free_I0, friction)
    try:
        return fit(seen, runs, (mu_s, mu_2))
    finally:
        runs.stop()


CHECK = Check("simulator_fit", SimulatorFit, make, seconds=300.0, flag="resimulate", quick=False)
