"""A simulation with an identified law, sampled as a measured flow was: its flow without noise.

The flow keeps its frames, its grid or its scattered places, its constants and its stated standard
deviations. A vector is there where the measured flow has one and the simulation holds nothing but
grains. Velocity and c are bilinear between the cells of the simulation. Where c of the measured
flow is a mask (0 or 1), it is one again, of the cells that are half full.

Every point of the surface line moves to the nearest place at which c of the simulation falls
through 1/2 in the same frame; in a layer it moves to the height of the layer. So the line has as
many points in every part as the measured one. It is exact: `surface_sd` is 0.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from granpinn.arrays import Float32, Float64
from granpinn.data import Flow, Truth
from granpinn.data.flow import SURFACE_SD, WINDOW, Particles, Surface
from granpinn.data.particles import grid_view
from granpinn.second_opinion.comparison import Nodes, interpolation
from granpinn.simulation.engine import State
from granpinn.simulation.recorder import column_heights
from granpinn.simulation.scene import Scene

HALF = 0.5  # of c at the surface
BELOW_FULL = np.nextafter(np.float32(1), np.float32(0))  # largest c of a cell that is not full


class Sampler:
    """Takes the frames of a simulation as a measured flow was sampled.

    Attributes:
        scene: the settings of the simulation, resolved.
    """

    def __init__(self, scene: Scene, flow: Flow) -> None:
        self.scene, self._measured = scene.resolved(), flow
        self._taken: list[dict[str, Float32]] = []
        self._lines: list[Surface] = []
        self._vectors: list[Particles] = []

    def add(self, time: float, state: State) -> None:
        """Take the next frame."""
        k, flow = len(self._taken), self._measured
        if self.scene.PERIODIC:
            state = _even(state)
        if flow.particles is None:
            self._taken.append(self._on_grid(k, state))
        else:
            self._taken.append({})
            self._vectors.append(self._at_particles(k, flow.particles, state))
        if flow.surface is not None:
            self._lines.append(self._line(k, flow.surface, state))

    def flow(self) -> Flow:
        """The flow of all frames, with the law of the simulation as its truth."""
        flow, s = self._measured, self.scene
        # The simulation is sampled at points.
        attributes = {k: value for k, value in flow.attributes.items() if k != WINDOW}
        surface = None if flow.surface is None else _joined(Surface, self._lines)
        changed: dict[str, Any] = {
            "p": None,
            "surface": surface,
            "truth": Truth(law=s.law, **dict(zip(s.friction_law.names, s.theta, strict=True))),
            "attributes": attributes | {SURFACE_SD: 0.0},
            "sha256": "",
            "path": None,
        }
        if flow.particles is not None:
            vectors = _joined(Particles, self._vectors)
            return replace(flow, **grid_view(vectors), particles=vectors, **changed)
        fields: dict[str, Any] = {
            name: np.stack([f[name] for f in self._taken]) for name in ("u", "v", "c")
        }
        fraction = (flow.c > 0) & (flow.c < 1)
        if not fraction.any():
            fields["c"] = (fields["c"] >= HALF).astype(np.float32)
        return replace(flow, **fields, **changed)

    def _on_grid(self, k: int, state: State) -> dict[str, Float32]:
        """u, v and c of a frame at the grid of the measured flow [Y, X]."""
        flow, y, x = self._measured, *self._axes(state)
        if self.scene.PERIODIC:
            state, x = _spread(state, len(flow.x)), flow.x
        # Between a wall and the first center of a cell, the values are those of this cell.
        at = interpolation(Nodes(y, x), Nodes(np.maximum(flow.y, y[0]), np.maximum(flow.x, x[0])))
        empty = state.c < 1
        u, v = (at(np.where(empty, np.nan, f)) for f in (state.u_center, state.v_center))
        full = np.isfinite(u) & np.isfinite(v)
        c = np.minimum(np.nan_to_num(at(state.c)).astype(np.float32), BELOW_FULL)
        seen = full & np.isfinite(flow.u[k]) & np.isfinite(flow.v[k])
        return {
            "u": np.where(seen, u, np.nan).astype(np.float32),
            "v": np.where(seen, v, np.nan).astype(np.float32),
            "c": np.where(full, np.float32(1), c),
        }

    def _at_particles(self, k: int, particles: Particles, state: State) -> Particles:
        """The vectors of a frame at the places of the measured ones, where grains are."""
        now = _frames(self._measured, particles.t) == k
        y, x = self._axes(state)
        h = self.scene.spacing
        places = np.stack([(particles.y[now] - y[0]) / h, (particles.x[now] - x[0]) / h])
        places = np.maximum(places, 0.0)
        inside = (places <= np.array(state.c.shape)[:, None] - 1).all(axis=0)

        def at(field: Float64) -> Float64:
            found: Float64 = map_coordinates(field, places, order=1, mode="nearest")
            return found

        there = inside & (at((state.c >= 1).astype(np.float64)) > 1 - 1e-9)
        kept = np.flatnonzero(now)[there]
        rest: dict[str, Any] = {
            n: None if a is None else a[kept] for n, a in vars(particles).items()
        }
        rest["u"], rest["v"] = (
            at(f)[there].astype(np.float32) for f in (state.u_center, state.v_center)
        )
        return Particles(**rest)

    def _line(self, k: int, line: Surface, state: State) -> Surface:
        """The points of the line of a frame, on the surface of the simulation."""
        flow, h = self._measured, self.scene.spacing
        now = _frames(flow, line.t) == k
        points = np.stack([line.x[now], line.y[now]], axis=1)
        if self.scene.LEVEL_SURFACE:
            points[:, 1] = column_heights(state, h)[1].mean()
        elif len(places := crossings(state.c, h)):
            points = places[cKDTree(places).query(points)[1]]
        else:
            points = points[:0]
        p = None if line.p is None else _nearest(state.p, points, h)
        return Surface(np.full(len(points), flow.t[k]), points[:, 0], points[:, 1], p)

    def _axes(self, state: State) -> tuple[Float64, Float64]:
        """The centers of the cells of a state."""
        h = self.scene.spacing
        y, x = (h * (np.arange(n, dtype=np.float64) + 0.5) for n in state.c.shape)
        return y, x


def crossings(c: Float64, h: float) -> Float64:
    """x, y of the places between neighboring cells at which c [ny, nx] crosses 1/2 [n, 2].

    Linear between the centers; the surface reaches the walls at x = 0 and y = 0 in the same way.

    Args:
        h: cell size.
    """
    padded = np.pad(c, ((1, 0), (1, 0)), mode="edge") - HALF
    found = []
    for axis in (0, 1):
        a = padded[:-1] if axis == 0 else padded[:, :-1]
        b = padded[1:] if axis == 0 else padded[:, 1:]
        j, i = np.nonzero((a >= 0) != (b >= 0))
        part = a[j, i] / (a[j, i] - b[j, i])
        y, x = (j + part, i + 0.0) if axis == 0 else (j + 0.0, i + part)
        found.append(np.stack([x, y], axis=1))
    return np.maximum((np.concatenate(found) - 0.5) * h, 0.0)


def _even(state: State) -> State:
    """A layer with the mean of its columns in each of them."""

    def mean(field: Float64) -> Float64:
        return np.broadcast_to(field.mean(axis=1, keepdims=True), field.shape)

    return replace(state, **{name: mean(field) for name, field in vars(state).items()})


def _spread(state: State, count: int) -> State:
    """A layer of the same columns with `count` of them."""

    def repeated(name: str, field: Float64) -> Float64:
        columns = count + field.shape[1] - state.c.shape[1]
        return np.broadcast_to(field[:, :1], (len(field), columns))

    return replace(state, **{name: repeated(name, field) for name, field in vars(state).items()})


def _frames(flow: Flow, t: Float64) -> Any:
    """The frame nearest to every time [n]."""
    return np.searchsorted((flow.t[1:] + flow.t[:-1]) / 2, t)


def _nearest(field: Float64, points: Float64, h: float) -> Float32:
    """Values of the cells [ny, nx] that hold the points [n, 2]."""
    i, j = (np.clip((points / h).astype(int).T[a], 0, field.shape[1 - a] - 1) for a in (0, 1))
    return np.asarray(field[j, i], np.float32)


def _joined(kind: Any, parts: Any) -> Any:
    """Surfaces or particles of all frames as one."""
    columns = {name: [getattr(part, name) for part in parts] for name in vars(parts[0])}
    return kind(
        **{name: None if v[0] is None else np.concatenate(v) for name, v in columns.items()}
    )
