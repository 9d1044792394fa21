"""Flows as a measurement shows them: exact fields on a grid, as points, cell or window averages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.studies.floor.fields import END, GRAIN, PHYSICS, THETA, WIDTH, Exact, exact
from granpinn.arrays import Bool, Float64
from granpinn.data import Flow
from granpinn.data.flow import SURFACE_SD, Surface, Truth

TOP = 1.06  # of the grid, above every surface
NODES = 4  # of a Gauss rule, along each side of a cell or window
WINDOW = 2.0  # spacings: neighboring windows overlap by half

Vectors = Literal["point", "cell", "window"]


@dataclass(frozen=True)
class Sampling:
    """How the exact fields are measured.

    Attributes:
        cells: per unit of length.
        frames: after that at t = 0.
        vectors: at the centers of the cells, or means over the grains of a cell, or of a window.
        partial: whether cells and windows on the surface have a vector too, that of their grains.
        line: points of the surface line per cell.
        surface_pressure: p on the surface.
    """

    cells: int = 64
    frames: int = 40
    vectors: Vectors = "point"
    partial: bool = True
    line: float = 1.0
    surface_pressure: float = 0.0


def sample(name: str, of: Sampling) -> Flow:
    """A manufactured flow as a `Flow` with its source term."""
    fields = exact(name, of.surface_pressure)
    spacing = 1 / of.cells
    x, y = (centers(round(size * of.cells), spacing) for size in (WIDTH, TOP))
    t = np.linspace(0, END, of.frames + 1)
    frames = [_frame(fields, of, float(now), x, y) for now in t]
    u, v, c = (np.stack(part).astype(np.float32) for part in zip(*frames, strict=True))
    return Flow(
        t=t,
        y=y,
        x=x,
        u=u,
        v=v,
        c=c,
        gravity=(PHYSICS.g_x, PHYSICS.g_y),
        density=1.0,
        grain_diameter=GRAIN,
        surface=_line(fields, of, t),
        truth=Truth(*THETA),
        attributes={SURFACE_SD: 0.0},  # the line is exact
        source=fields.source,
    )


def centers(count: int, spacing: float) -> Float64:
    """Centers of the cells of an axis that begins at 0 [count]."""
    return np.asarray(spacing * (np.arange(count) + 0.5), dtype=np.float64)


def _line(fields: Exact, of: Sampling, t: Float64) -> Surface:
    """The surface line in all frames, with its pressure."""
    along = np.linspace(0, WIDTH, max(2, round(of.line * WIDTH * of.cells)) + 1)
    times, places = (a.ravel() for a in np.meshgrid(t, along, indexing="ij"))
    p = np.full(times.shape, of.surface_pressure, np.float32)
    return Surface(times, places, fields.height(places, times), p)


def _frame(
    fields: Exact, of: Sampling, now: float, x: Float64, y: Float64
) -> tuple[Float64, Float64, Float64]:
    """u, v and the filled fraction c of one frame [Y, X]."""
    half = (WINDOW if of.vectors == "window" else 1.0) / of.cells / 2
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    surface = fields.height(x[:, None] + half * nodes, np.full((1, 1), now))  # [X, node]
    bottom = np.maximum(y - half, 0.0)[:, None, None]  # a window ends at the floor
    deep = np.clip((surface - bottom) / (y[:, None, None] + half - bottom), 0.0, 1.0)
    c = np.where((deep == 1).all(-1), 1.0, np.minimum(deep @ (weights / 2), np.nextafter(1, 0)))
    if of.vectors == "point":
        below = y[:, None] < fields.height(x, np.full_like(x, now))
        places = np.broadcast_arrays(x, y[:, None], np.full((1, 1), now))
        u, v = (part.reshape(below.shape) for part in fields.velocity(*map(np.ravel, places)))
        there = below & (c > 0)
    else:
        u, v, there = _means(fields, x, y, now, half)
    there &= (c == 1) | of.partial
    return np.where(there, u, np.nan), np.where(there, v, np.nan), c.astype(np.float32)


def _means(
    fields: Exact, x: Float64, y: Float64, now: float, half: float
) -> tuple[Float64, Float64, Bool]:
    """Means of u and v over the grains within `half` of the centers, and where there are any."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    sums = np.zeros((3, y.size, x.size))
    for a, w_a in zip(nodes, weights, strict=True):
        for b, w_b in zip(nodes, weights, strict=True):
            column, row = x + half * a, y[:, None] + half * b
            places = np.broadcast_arrays(column, row, np.full((1, 1), now))
            here = [np.ravel(place) for place in places]
            u, v = fields.velocity(*here)
            grains = (here[1] > 0) & (here[1] < fields.height(here[0], here[2]))
            found = np.where(grains, np.stack([u, v, np.ones_like(u)]), 0.0)
            sums += w_a * w_b * found.reshape(sums.shape)
    there = sums[2] > 0
    u, v = (np.divide(part, sums[2], where=there, out=np.zeros_like(part)) for part in sums[:2])
    return u, v, there
