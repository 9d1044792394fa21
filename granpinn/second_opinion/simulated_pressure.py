"""Simulated pressure: the pressure of a simulation that starts from a known velocity.

Where nothing shears, the velocity does not fix the pressure (docs/explanation/pressure.md), and the
pressure of the network is a smooth continuation. The simulated pressure is defined there too. The
simulation starts from the velocity of the network at one time, with the grains of that time and the
identified law. It computes the pressure from the momentum balance, the law clamped at eta_max, the
floor and the plane of symmetry (granpinn/simulation/settling.py). In flowing grains the two
pressures agree. In resting grains the simulated pressure is of a material that creeps at eta_max.
So their difference measures the freedom of the pressure. Frames are simulated side by side.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from granpinn.arrays import Float64
from granpinn.config import ConfigError
from granpinn.data import Flow
from granpinn.physics.laws import FrictionLaw
from granpinn.second_opinion import layers, scenes
from granpinn.second_opinion.boundaries import foreign_wall
from granpinn.second_opinion.comparison import Nodes, interpolation
from granpinn.second_opinion.threads import threads
from granpinn.simulation.chute import Chute
from granpinn.simulation.engine import SimulationError, Start, State
from granpinn.simulation.parameters import Collapse
from granpinn.simulation.settling import settle, settled_after

# (x, y, t) -> (u, v), all [n], in the units and axes of the flow.
Velocity = Callable[[Float64, Float64, float], tuple[Float64, Float64]]
Listener = Callable[[int, int], None]

SUBCELLS = 4  # samples along the side of a cell, for its volume fraction
NEAR = 3  # cells of air around the grains that have the velocity of the grains
FAILED, LATE = "failed", "late"
NO_FRAME = "no frame after the start shows all of the grains"


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
    listener: Listener | None = None,
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
        listener: called with the number of finished frames and of all frames.
    """
    usable = usable_frames(flow)
    if isinstance(usable, str):
        return usable
    scene: dict[int, Chute] | Collapse
    chosen = evenly(usable, frames)
    try:
        if flow.periodic:
            scene = {k: layer_in(flow, k, law, theta, cells, wall_friction) for k in chosen}
        else:
            scene = collapse_over(flow, usable, law, theta, cells, wall_friction)
    except ConfigError as error:
        return str(error)
    lock, done = threading.Lock(), 0

    def one(k: int) -> Float64 | str:
        """The pressure of frame k, or why there is none."""
        nonlocal done
        if deadline is not None and time.monotonic() > deadline:
            return LATE
        try:
            if isinstance(scene, Collapse):
                p = above_floor(flow, k, scene, velocity)
            else:
                p = in_layer(flow, k, scene[k], velocity)
        except SimulationError:
            return FAILED
        with lock:
            done += 1
            if listener is not None:
                listener(done, len(chosen))
        return p if np.isfinite(p).all() else FAILED

    own = min(len(os.sched_getaffinity(0)), len(chosen))
    with threads(own) if pool is None else nullcontext(pool) as workers:
        # The last frame comes first, so that a time limit leaves out early frames.
        found = dict(zip(chosen[::-1], workers.map(one, chosen[::-1]), strict=True))
    missing = [p for p in found.values() if isinstance(p, str)]
    return Pressures(
        {k: p for k in chosen if not isinstance(p := found[k], str)},
        (scene if isinstance(scene, Collapse) else scene[chosen[-1]]).cells,
        missing.count(FAILED),
        missing.count(LATE),
    )


def above_floor(flow: Flow, k: int, collapse: Collapse, velocity: Velocity) -> Float64:
    """The pressure of frame k [Y, X] between the walls of a collapse."""
    start = start_of(flow, k, collapse, velocity, settled_after(collapse))
    return pressure_at(flow, settle(collapse, start), collapse.spacing)


def in_layer(flow: Flow, k: int, chute: Chute, velocity: Velocity) -> Float64:
    """The pressure of frame k [Y, X] in an even layer on a slope."""
    time = max(float(flow.t[k]) - settled_after(chute), 0.0)
    state = settle(chute, layers.start_of(chute, velocity, time))
    return layers.pressure_at(flow, state, chute.spacing)


def layer_in(
    flow: Flow,
    k: int,
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None,
    wall_friction: float | None = None,
) -> Chute:
    """The layer of frame k, resolved; ConfigError if it is invalid."""
    chute = layers.chute_of(flow, layers.depth_of(flow, k), law, theta, cells, wall_friction)
    return replace(chute, threads=1).resolved()


def collapse_over(
    flow: Flow,
    frames: list[int],
    law: FrictionLaw,
    theta: Sequence[float],
    cells: int | None,
    wall_friction: float | None = None,
) -> Collapse:
    """The box around the grains of some frames, resolved; ConfigError if it is invalid."""
    ever_full = np.asarray((flow.c[frames] >= 0.5).any(axis=0))
    everywhere = scenes.extent(flow, ever_full)
    collapse = scenes.collapse_of(flow, everywhere, law, theta, cells, wall_friction)
    return replace(collapse, threads=1).resolved()


def usable_frames(flow: Flow) -> list[int] | str:
    """The frames at which a simulation can start, or the reason why there are none."""
    if flow.periodic:
        there = flow.after_start(flow.t) & flow.material.any(axis=(1, 2))
        return layers.not_a_layer(flow) or np.flatnonzero(there).tolist() or NO_FRAME
    if flow.steady:
        return scenes.STEADY
    if objection := foreign_wall(flow, scenes.box_of(flow)):
        return objection
    after = np.flatnonzero((flow.t > 0) & flow.material.any(axis=(1, 2))).tolist()
    standing = [k for k in after if scenes.in_corner(flow, k)]
    if after and not standing:
        return f"the grains {scenes.CORNER}"
    if scenes.box_of(flow) is None:
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
    dx, dy = scenes.spacings(flow)
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
