"""The line of the free surface: its height in columns, its normals, and how well it is known.

An offset of the line is a distance along its outward normal, the same for the whole line. The
normal of a point is that of its neighbors on the line at the same time: the direction in which they
are spread least. It points away from the nearest grains, so steep and folded lines are moved
outwards too. The standard deviation of the offset is, in this order:

- **Stated.** The file says it (`surface_sd`, 0 for an exact line).
- **A solver.** The surface is sharp and known to half a cell of the solver; errors of this size are
  in the error model, so the standard deviation is 0. It is the distance between
  the line and the place where c falls through 1/2, if that distance is larger.
- **Grains.** A surface of grains is defined to half a grain. The same distance counts if it is
  larger. Where c is a mask (0 or 1), the line may lie anywhere between two rows of vectors: half a
  spacing counts.

Level V0 has no line but the outline of the data. It may lie anywhere between two rows, whatever the
file says about a line.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy

from granpinn.arrays import Bool, Float64, Floats, Index, nearest
from granpinn.data.flow import SOLVER_CELL, SURFACE_SD, Flow, Surface

SAME_TIME = 1e-6  # relative difference of times that are one
STEEP = 2.0  # slope of the line from which it has no single height within a cell
ON_LINE, GRAINS = 7, 4  # nearest points on the line, nearest vectors
HALF = 0.5  # of c at the surface, of a grain, of a spacing
REACH, STEP = 2.0, 0.25  # of the profile of c across the line, in spacings


def line_heights(t: Float64, x: Float64, line: Surface) -> Float64:
    """Height of the surface line in every frame and column [T, X], linear between its points.

    Points belong to the frame nearest in time. A frame has the line of the time nearest to its own
    among them. Without a line, and beyond its ends, the height is NaN.

    Args:
        t: times of the frames [T], increasing.
        x: places of the columns [X].
    """
    height = np.full((len(t), len(x)), np.nan)
    for k, now in points_of(t, line.t):
        now = now[np.argsort(line.x[now], kind="stable")]
        height[k] = np.interp(x, line.x[now], line.y[now], left=np.nan, right=np.nan)
    return height


def folded(t: Float64, x: Float64, line: Surface) -> Bool:
    """Where the line is vertical or folds: its points within a column differ by more than `STEEP`
    columns in height [T, X]. Arguments as in `line_heights`."""
    limit = STEEP * float(np.median(np.diff(x)))
    low, high = np.full((len(t), len(x)), np.inf), np.full((len(t), len(x)), -np.inf)
    for k, now in points_of(t, line.t):
        column = nearest(x, line.x[now])
        np.minimum.at(low[k], column, line.y[now])
        np.maximum.at(high[k], column, line.y[now])
    steep: Bool = high - low > limit
    return steep


def points_of(t: Float64, line_t: Float64) -> Iterator[tuple[int, Index]]:
    """The frames that have a line, and the numbers of its points [k] (`line_heights`)."""
    frame = nearest(t, line_t)
    gap = np.abs(line_t - t[frame])
    order = np.lexsort((gap, frame))
    closest = np.full(len(t), np.nan)
    first = order[np.unique(frame[order], return_index=True)[1]]
    closest[frame[first]] = line_t[first]
    same = np.abs(line_t - closest[frame]) <= SAME_TIME * np.abs(closest[frame])
    point = np.flatnonzero(same)
    point = point[np.argsort(frame[point], kind="stable")]
    edges = np.searchsorted(frame[point], np.arange(len(t) + 1))
    for k in np.flatnonzero(np.diff(edges)):
        yield int(k), point[edges[k] : edges[k + 1]]


def moved(flow: Flow, surface: Surface, *offsets: float) -> list[Surface]:
    """Points of the surface of a flow, moved outwards by each offset, in the unit of length."""
    n_x, n_y = outward_normals(flow, surface).T
    return [replace(surface, x=surface.x + a * n_x, y=surface.y + a * n_y) for a in offsets]


def outward_normals(flow: Flow, surface: Surface) -> Float64:
    """Unit normals (n_x, n_y) of the points of the line, away from the grains [n, 2]."""
    up = -np.asarray(flow.gravity) / np.hypot(*flow.gravity)
    line = np.stack([surface.x, surface.y], -1)
    found = np.empty(line.shape)
    frames, vectors = _vectors(flow)
    times = np.unique(surface.t)
    for k, now in points_of(times, surface.t):
        points = line[now]
        normals = _normals(points, up)
        grains = vectors[int(np.argmin(np.abs(frames - times[k])))]
        away = np.broadcast_to(up, points.shape)
        if len(grains):
            near = scipy.spatial.cKDTree(grains).query(points, min(GRAINS, len(grains)))[1]
            away = points - grains[near.reshape(len(points), -1)].mean(axis=1)
        side = np.sign(np.sum(normals * away, axis=1))
        found[now] = normals * np.where(side == 0, 1.0, side)[:, None]
    return found


def _normals(points: Float64, up: Float64) -> Float64:
    """Directions of the least spread of the nearest points [n, 2]; `up` for too few points."""
    places, place = np.unique(points, axis=0, return_inverse=True)  # points may repeat
    if len(places) < 3:
        return np.broadcast_to(up, points.shape)
    near = places[scipy.spatial.cKDTree(places).query(places, min(ON_LINE, len(places)))[1]]
    around = near - near.mean(axis=1, keepdims=True)
    spread = np.einsum("nki,nkj->nij", around, around)
    return np.asarray(np.linalg.eigh(spread)[1][:, :, 0])[place]


def _vectors(flow: Flow) -> tuple[Float64, list[Float64]]:
    """Times [T], and the places of the vectors of each [k, 2]."""
    p = flow.particles
    if p is not None:
        times, places = np.unique(p.t), np.stack([p.x, p.y], -1)
        return times, [places[now] for _, now in points_of(times, p.t)]
    frame, row, column = np.nonzero(flow.valid)
    ends = np.searchsorted(frame, np.arange(1, flow.t.size))
    return flow.t, np.split(np.stack([flow.x[column], flow.y[row]], -1), ends)


def surface_sd(flow: Flow, level: str) -> float:
    """The standard deviation of the offset of the surface of a level, in the unit of length.

    Args:
        flow: as in its file, before partly filled cells count as full.
    """
    grain, cell = flow.grain_diameter, flow.stated(SOLVER_CELL)
    between_rows = 0.0 if flow.particles is not None else HALF * flow.spacing[1]
    if level == "V0" or flow.surface is None:
        return 0.0 if cell is not None else max(HALF * grain, between_rows)
    if SURFACE_SD in flow.attributes:
        return float(flow.attributes[SURFACE_SD])
    if flow.particles is not None:
        return HALF * grain
    distance = distance_to_fraction(flow, flow.surface)
    if cell is not None:
        return distance if distance > HALF * cell else 0.0
    mask = _share_of_fractions(flow, flow.surface) < HALF
    return max(HALF * grain, distance, between_rows if mask else 0.0)


def distance_to_fraction(flow: Flow, surface: Surface) -> float:
    """Distance of the line from the place where c falls through 1/2, at most `REACH` spacings.

    c is averaged over the line at every distance from it, so errors of single points cancel.
    """
    h = flow.spacing[1]
    normals = outward_normals(flow, surface)
    across = np.arange(-REACH, REACH + STEP / 2, STEP)
    profile = np.array([_c_at(flow, surface, a * h * normals).mean() for a in across])
    falling = np.minimum.accumulate(profile)
    return abs(float(np.interp(HALF, falling[::-1], across[::-1]))) * h


def _share_of_fractions(flow: Flow, surface: Surface) -> float:
    """Share of the points of the line whose nearest cell is filled in part."""
    c = _c_at(flow, surface, np.zeros((surface.t.size, 2)), order=0)
    return float(np.mean((c > 0) & (c < 1)))


def _c_at(flow: Flow, surface: Surface, shift: Float64, order: int = 1) -> Floats:
    """c at the points of the line after a shift [n, 2]; order 1: linear, 0: of the nearest cell."""
    row = np.interp(surface.y + shift[:, 1], flow.y, np.arange(flow.y.size))
    column = np.interp(surface.x + shift[:, 0], flow.x, np.arange(flow.x.size))
    places = np.stack([nearest(flow.t, surface.t), row, column])
    found: Floats = scipy.ndimage.map_coordinates(flow.c, places, order=order, mode="nearest")
    return found
