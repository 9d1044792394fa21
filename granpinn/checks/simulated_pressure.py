"""Simulated pressure: the pressure of a simulation that starts from the predicted velocity.

Where nothing shears, the velocity does not fix the pressure (docs/explanation/pressure.md), and the
pressure of the network is a smooth continuation. The simulated pressure is defined there too. The
simulation starts from the velocity of the network at one time, with the grains of that time and the
identified law. It computes the pressure from the momentum balance, the law clamped at eta_max, the
floor and the plane of symmetry (granpinn/simulation/engine.py). In flowing grains the two
pressures agree. In resting grains the simulated pressure is of a material that creeps at eta_max.
So their difference measures the freedom of the pressure. Frames are simulated side by side.
"""

from __future__ import annotations

import dataclasses
import math
import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from granpinn.arrays import Float64
from granpinn.config import ConfigError
from granpinn.data import Flow
from granpinn.data.norms import relative_l2
from granpinn.data.symmetry import axes_of
from granpinn.fit import prediction, scoring
from granpinn.fit.case import Case, Model
from granpinn.fit.context import Context
from granpinn.physics.laws import FrictionLaw
from granpinn.results import Fields, append_variable
from granpinn.results.record import Check, Record
from granpinn.simulation.engine import SimulationError, Start, State, settle, settled_after
from granpinn.simulation.likeness import (
    CORNER,
    Nodes,
    box_of,
    collapse_of,
    extent,
    in_corner,
    interpolation,
    unlike,
)
from granpinn.simulation.parameters import Collapse
from granpinn.simulation.threads import threads

# (x, y, t) -> (u, v), all [n], in the units and axes of the flow.
Velocity = Callable[[Float64, Float64, float], tuple[Float64, Float64]]

EACH_FRAME = 0.5  # seconds of a frame on one idle core; none begins later before a time limit
SAY_EVERY = 10.0  # seconds
SUBCELLS = 4  # samples along the side of a cell, for its volume fraction
NEAR = 3  # cells of air around the grains that have the velocity of the grains
FAILED, LATE = "failed", "late"
NO_FRAME = "no frame after the start shows all of the grains"


@dataclass(frozen=True)
class SimulatedPressure(Record):
    """The simulated pressure at some frames.

    Attributes:
        objection: the reason for its absence; all numbers are then None.
        cells: across the box.
        frames: indices of the frames that have a simulated pressure.
        failed: frames at which a solve did not converge.
        late: frames that the time limit left out.
        seconds: for all frames.
        flowing_percent, stagnant_percent: rms difference of the predicted and the simulated
            pressure over the rms of the simulated one, by zones (fit/scoring.py); None for an
            empty zone.
    """

    title = "Simulated pressure"
    notes = (
        "The motion does not determine the pressure where grains do not shear: values in resting "
        "grains are a plausible continuation and no more. The simulated pressure is of a "
        "simulation that starts from the predicted velocity, with the identified law. In resting "
        "grains it is of a material that creeps at the largest viscosity between the simulator's "
        "floor and plane of symmetry. The difference is what the motion leaves open."
    )

    objection: str | None
    cells: int | None = None
    frames: tuple[int, ...] = ()
    failed: int = 0
    late: int = 0
    seconds: float | None = None
    flowing_percent: float | None = None
    stagnant_percent: float | None = None

    @property
    def words(self) -> str:
        if self.objection is not None:
            return f"no simulated pressure: {self.objection}"
        parts = [f"{self.failed} did not converge"] if self.failed else []
        parts += [f"{self.late} had no time left"] if self.late else []
        left_out = f" (left out: {', '.join(parts)})" if parts else ""
        if not self.frames:
            return f"no simulated pressure{left_out}"
        zones = {"flowing": self.flowing_percent, "resting": self.stagnant_percent}
        parts = [f"{p:.1f} % in {zone} grains" for zone, p in zones.items() if p is not None]
        return (
            f"simulated pressure at {len(self.frames)} times: the predicted pressure differs by "
            f"{' and '.join(parts) or 'an unknown amount'}{left_out}"
        )

    def figures(self) -> dict[str, tuple[str, Callable[[Any], Any]]]:
        if not self.frames:
            return {}
        from granpinn.figures.album import fields_of
        from granpinn.figures.maps import simulated_pressure

        drawing = lambda source: simulated_pressure(fields_of(source), source.frame)  # noqa: E731
        return {"pressure_simulated": (self.title, drawing)}


def make(context: Context) -> SimulatedPressure | None:
    """The record; `p_simulated` is a further field, and the errors of fields count it."""
    case, model, run = context.case, context.model, context.run
    settings = case.config.simulated_pressure
    if not settings.frames or context.shear is None:  # no fields either
        return None
    begin = said = time.monotonic()

    def say(done: int, frames: int) -> None:
        nonlocal said
        if time.monotonic() - said > SAY_EVERY:
            said = time.monotonic()
            run.progress.message(f"simulating the pressure {done}/{frames}")

    found = at_frames(
        case.flow,
        model.law,
        model.law.to_physical(model.theta.tolist(), model.scales.pressure),
        velocity_of(case.flow, model),
        settings.frames,
        settings.cells,
        wall_friction=case.config.side_walls.friction,
        pool=context.pool,
        deadline=None if run.limit is None else run.limit.until - EACH_FRAME,
        listener=say,
    )
    if isinstance(found, str):
        return SimulatedPressure(found)
    seconds = time.monotonic() - begin
    record = SimulatedPressure(
        None, found.cells, tuple(found.at), found.failed, found.late, seconds
    )
    if not found.at:
        return record
    fields = with_simulated_pressure(context.predicted(), found.at)
    if context.fields is not None:
        context.fields = fields
    context.score(fields)
    if context.folder is not None:
        append_variable(fields, "p_simulated", context.folder / "fields.h5")
    flowing, stagnant = difference(case, fields)
    return dataclasses.replace(record, flowing_percent=flowing, stagnant_percent=stagnant)


class Pressures(NamedTuple):
    """
    Attributes:
        at: the pressure [Y, X] at the grid of the flow, by frame.
        cells: across the box.
        failed: frames at which a solve did not converge.
        late: frames that the time limit left out.
    """

    at: dict[int, Float64]
    cells: int
    failed: int
    late: int


def at_frames(
    flow: Flow,
    law: FrictionLaw,
    theta: Sequence[float],
    velocity: Velocity,
    frames: int,
    cells: int | None = None,
    *,
    wall_friction: float | None = None,
    pool: Executor | None = None,
    deadline: float | None = None,
    listener: Callable[[int, int], None] | None = None,
) -> Pressures | str:
    """The pressure at evenly spaced frames, or the reason why there is none.

    Args:
        theta: parameters of the law, in its order.
        velocity: of the grains, at any point and any time.
        frames: largest number of frames; the last usable frame is among them.
        cells: across the box; None for the grid of the solver, or of the data, at most 512.
        wall_friction: of side walls, if the flow states their distance.
        pool: of the threads that work side by side; None for all cores at hand.
        deadline: value of time.monotonic() after which no further frame is begun.
        listener: called with the number of frames that ended and of all frames.
    """
    usable = usable_frames(flow)
    if isinstance(usable, str):
        return usable
    chosen = evenly(usable, frames)
    everywhere = extent(flow, np.asarray((flow.c[usable] >= 0.5).any(axis=0)))
    try:  # one box for all frames
        scene = collapse_of(flow, everywhere, law, theta, cells, wall_friction)
        scene = dataclasses.replace(scene, threads=1).resolved()
    except ConfigError as error:
        return str(error)
    before = settled_after(scene)

    def one(k: int) -> Float64 | str:
        """The pressure of frame k [Y, X], or why there is none."""
        if deadline is not None and time.monotonic() > deadline:
            return LATE
        try:
            state = settle(scene, start_of(flow, k, scene, velocity, before))
            p = pressure_at(flow, state, scene.spacing)
        except SimulationError:
            return FAILED
        return p if np.isfinite(p).all() else FAILED

    own = min(len(os.sched_getaffinity(0)), len(chosen))
    found: dict[int, Float64 | str] = {}
    with threads(own) if pool is None else nullcontext(pool) as workers:
        # The last frame comes first, so that a time limit leaves out early frames.
        for k, p in zip(chosen[::-1], workers.map(one, chosen[::-1]), strict=True):
            found[k] = p
            if listener is not None:
                listener(len(found), len(chosen))
    missing = [p for p in found.values() if isinstance(p, str)]
    return Pressures(
        {k: p for k in chosen if not isinstance(p := found[k], str)},
        scene.cells,
        missing.count(FAILED),
        missing.count(LATE),
    )


def usable_frames(flow: Flow) -> list[int] | str:
    """The frames at which a simulation can start, or the reason why there are none."""
    if objection := unlike(flow):
        return objection
    after = np.flatnonzero((flow.t > 0) & flow.material.any(axis=(1, 2))).tolist()
    standing = [k for k in after if in_corner(flow, k)]
    if after and not standing:
        return f"the grains {CORNER}"
    if box_of(flow) is None:
        # A picture may cut grains off. The file of a simulation states its box instead.
        edges = np.concatenate([flow.c[:, :, -1], flow.c[:, -1]], axis=1)
        cut_off = np.asarray((edges >= 0.5).any(axis=1))
        standing = [k for k in standing if not cut_off[k]]
    return standing or NO_FRAME


def evenly(frames: list[int], count: int) -> list[int]:
    """At most `count` of the frames, evenly spaced, the last one included."""
    n = len(frames)
    count = min(count, n)
    return [frames[math.ceil(n * k / count) - 1] for k in range(1, count + 1)]


def start_of(
    flow: Flow, k: int, collapse: Collapse, velocity: Velocity, before: float = 0.0
) -> Start:
    """Frame k on the grid of a resolved collapse: grains, and the velocity on its faces.

    Both belong to the time `before` the frame, which is the duration of the simulation.
    """
    nx, ny, h = collapse.cells, collapse.cells_y, collapse.spacing
    c = fraction_of(flow, k, collapse, before)
    near = binary_dilation(c > 0, iterations=NEAR)
    # Nothing passes the plane of symmetry, the floor and the other sides.
    on_x, on_y = np.zeros((ny, nx + 1), bool), np.zeros((ny + 1, nx), bool)
    on_x[:, 1:-1] = near[:, 1:] | near[:, :-1]
    on_y[1:-1] = near[1:] | near[:-1]
    (row, column), (row_y, column_y) = np.nonzero(on_x), np.nonzero(on_y)
    x = np.concatenate([column, column_y + 0.5]) * h
    y = np.concatenate([row + 0.5, row_y]) * h
    along, up = velocity(x, y, max(float(flow.t[k]) - before, 0.0))
    u, v = np.zeros(on_x.shape), np.zeros(on_y.shape)
    u[on_x], v[on_y] = along[: len(row)], up[len(row) :]
    return Start(c, u, v)


def fraction_of(flow: Flow, k: int, collapse: Collapse, before: float = 0.0) -> Float64:
    """Fraction of grains in the cells of a collapse [ny, nx] at the time `before` frame k.

    Grains end where c of the flow is a half by interpolation, linear in time and bilinear in space.
    """
    c = flow.c[k]
    if k > 0:
        c = c + min(before / (flow.t[k] - flow.t[k - 1]), 1.0) * (flow.c[k - 1] - c)
    n, h = SUBCELLS, collapse.spacing
    share = np.zeros((collapse.cells_y, collapse.cells))
    held = np.nonzero(c > 0)
    if not len(held[0]):
        return share
    # The next node behind the last one with grains has none.
    last = [min(k.max() + 1, len(axis) - 1) for k, axis in zip(held, (flow.y, flow.x), strict=True)]
    dx, dy = flow.spacing
    ends = flow.y[last[0]] + dy / 2, flow.x[last[1]] + dx / 2
    y, x = ((np.arange(n * count) + 0.5) * h / n for count in share.shape)
    y, x = y[y < ends[0]], x[x < ends[1]]
    ny, nx = -(-len(y) // n), -(-len(x) // n)
    full = np.zeros((n * ny, n * nx))
    at = interpolation(flow, _within(Nodes(y, x), flow.y, flow.x))
    full[: len(y), : len(x)] = at(c) >= 0.5
    share[:ny, :nx] = full.reshape(ny, n, nx, n).mean(axis=(1, 3))
    return share


def pressure_at(flow: Flow, state: State, spacing: float) -> Float64:
    """The pressure of a state at the grid of a flow [Y, X]; 0 beyond its window."""
    ny, nx = state.p.shape
    centers = Nodes(*(spacing * (np.arange(n, dtype=np.float64) + 0.5) for n in (ny, nx)))
    p = interpolation(centers, _within(Nodes(flow.y, flow.x), centers.y, centers.x))(state.p)
    p[flow.y > ny * spacing] = 0.0
    p[:, flow.x > nx * spacing] = 0.0
    return p


def _within(nodes: Nodes, y: Float64, x: Float64) -> Nodes:
    """Nodes beyond the ends of other axes, moved to these ends."""
    return Nodes(np.clip(nodes.y, y[0], y[-1]), np.clip(nodes.x, x[0], x[-1]))


def velocity_of(flow: Flow, model: Model) -> Velocity:
    """The predicted velocity at any point, in the units and axes of a flow."""
    axes = axes_of(flow)
    one_at_a_time = threading.Lock()  # torch uses all cores for one evaluation

    def velocity(x: Float64, y: Float64, t: float) -> tuple[Float64, Float64]:
        points = model.scales.points_to_dimensionless(x, y, t)
        with one_at_a_time:
            u, v = prediction.velocity(points, axes, model)
        return u, v

    return velocity


def with_simulated_pressure(fields: Fields, pressures: dict[int, Float64]) -> Fields:
    """The fields with a simulated pressure [Y, X] by frame; `p_simulated` is NaN at the others."""
    frame, place = np.divmod(fields.index, fields.y.size * fields.x.size)
    values = np.full(len(fields.index), np.nan, np.float32)
    for k, p in pressures.items():
        values[frame == k] = p.ravel()[place[frame == k]]
    return dataclasses.replace(fields, values=fields.values | {"p_simulated": values})


def difference(case: Case, fields: Fields) -> tuple[float | None, float | None]:
    """rms difference of predicted and simulated pressure over the rms of the simulated one, in %.

    One value for the flowing points and one for the stagnant points; None for an empty zone.
    """
    p, simulated = fields.values["p"], fields.values["p_simulated"]
    known = np.isfinite(simulated)
    flowing, stagnant = (
        relative_l2(p[known & zone], simulated[known & zone])
        for zone in scoring.zones_of(case.flow, fields, lambda: case.shared.strain_rate)
    )
    return flowing, stagnant


CHECK = Check("simulated_pressure", SimulatedPressure, make, seconds=7.0)
