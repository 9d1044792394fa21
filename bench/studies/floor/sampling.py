"""Flows as a measurement shows them: exact velocities on a grid of points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bench.studies.floor.fields import END, GRAIN, PHYSICS, THETA, WIDTH, Exact, exact
from granpinn.arrays import Float64
from granpinn.data import Flow
from granpinn.data.flow import SURFACE_SD, Surface, Truth

TOP = 1.06  # of the grid, above every surface
NODES = 4  # of the Gauss rule along x over a cell that the surface crosses


class Sampling(NamedTuple):
    """Cells per unit of length, and frames after that at t = 0."""

    cells: int = 64
    frames: int = 40


def sample(name: str, of: Sampling) -> Flow:
    """A manufactured flow as a `Flow` with its source term."""
    fields = exact(name)
    spacing = 1 / of.cells
    x, y = (centers(round(size * of.cells), spacing) for size in (WIDTH, TOP))
    t = np.linspace(0, END, of.frames + 1)
    frames = [_frame(fields, spacing, float(now), x, y) for now in t]
    u, v, c = (np.stack(part).astype(np.float32) for part in zip(*frames, strict=True))
    along = np.linspace(0, WIDTH, round(WIDTH * of.cells) + 1)
    times, places = (a.ravel() for a in np.meshgrid(t, along, indexing="ij"))
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
        surface=Surface(
            times, places, fields.height(places, times), np.zeros_like(times, np.float32)
        ),
        truth=Truth(*THETA),
        attributes={SURFACE_SD: 0.0},  # the line is exact
        source=fields.source,
    )


def centers(count: int, spacing: float) -> Float64:
    """Centers of the cells of an axis that begins at 0 [count]."""
    return np.asarray(spacing * (np.arange(count) + 0.5), dtype=np.float64)


def _frame(
    fields: Exact, spacing: float, now: float, x: Float64, y: Float64
) -> tuple[Float64, Float64, Float64]:
    """u and v at the centers among the grains, NaN above, and the filled fraction c [Y, X]."""
    bottom = y[:, None] - spacing / 2
    c = np.zeros((y.size, x.size))
    for node, weight in zip(*np.polynomial.legendre.leggauss(NODES), strict=True):
        surface = fields.height(x + spacing / 2 * node, np.full_like(x, now))
        c += weight / 2 * np.clip((surface - bottom) / spacing, 0.0, 1.0)
    c[c > 1 - 2.0**-20] = 1.0  # float32 has no fraction between
    places = np.broadcast_arrays(x, y[:, None], np.full((1, 1), now))
    there = (c > 0) & (places[1] < fields.height(x, np.full_like(x, now)))
    u, v = (part.reshape(c.shape) for part in fields.velocity(*map(np.ravel, places)))
    return np.where(there, u, np.nan), np.where(there, v, np.nan), c
