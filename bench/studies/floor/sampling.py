"""Flows as a measurement shows them: exact fields on a grid, as points, cell or window averages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.studies.floor.fields import END, GRAIN, PHYSICS, THETA, WIDTH, Exact, exact
from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.flow import SURFACE_SD, Surface, Truth

TOP = 1.06  # of the grid, above every surface
NODES = 4  # of a Gauss rule, along each side of a cell or window
WINDOW = 2.0  # spacings: neighboring windows overlap by half
LARGEST_PART = 1 - 2.0**-20  # c of a cell that is not full, as float32 below 1

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
    u, v, c = _means(fields, x, y, now, half)
    there = c > 0
    if of.vectors == "point":
        places = np.broadcast_arrays(x, y[:, None], np.full((1, 1), now))
        u, v = (part.reshape(c.shape) for part in fields.velocity(*map(np.ravel, places)))
        there &= y[:, None] < fields.height(x, np.full_like(x, now))
    there &= (c == 1) | of.partial
    return np.where(there, u, np.nan), np.where(there, v, np.nan), c


def _means(
    fields: Exact, x: Float64, y: Float64, now: float, half: float
) -> tuple[Float64, Float64, Float64]:
    """Means of u and v over the grains within `half` of the centers, and their part c [Y, X].

    A cell or window ends at the floor. Where the surface crosses it, the rule of Gauss along y
    covers the grains below, for each of its nodes along x.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    bottom, top = np.maximum(y - half, 0.0)[:, None], y[:, None] + half
    sums, full = np.zeros((3, y.size, x.size)), np.ones((y.size, x.size), bool)
    for a, w_a in zip(nodes, weights, strict=True):
        column = x + half * a
        surface = fields.height(column, np.full_like(x, now))
        depth = np.clip(surface - bottom, 0.0, top - bottom)
        full &= surface >= top
        for b, w_b in zip(nodes, weights, strict=True):
            places = np.broadcast_arrays(column, bottom + depth * (1 + b) / 2, np.full((1, 1), now))
            u, v = fields.velocity(*map(np.ravel, places))
            one = np.ones_like(u)
            sums += w_a * w_b * depth * np.stack([u, v, one]).reshape(sums.shape)
    grains = np.where(sums[2] > 0, sums[2], 1.0)
    c = np.where(full, 1.0, np.minimum(sums[2] / (4 * (top - bottom)), LARGEST_PART))
    return sums[0] / grains, sums[1] / grains, c
