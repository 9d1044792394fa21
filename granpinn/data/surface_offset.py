"""The free surface moved along its outward normal: what an error of the traced line does.

The normal of a point is that of its neighbors on the line at the same time: the direction in which
they are spread least. It points away from the nearest grains, so steep and folded lines are moved
outwards too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from granpinn.arrays import Float64
from granpinn.data.flow import Flow, FlowFileError, Surface

ON_LINE, GRAINS = 7, 4  # nearest points on the line, nearest vectors


def with_moved_surface(flow: Flow, offset: float) -> Flow:
    """The flow with its surface line moved outwards by `offset`, in the unit of length.

    Raises:
        FlowFileError: the flow has no surface line.
    """
    surface = flow.surface
    if surface is None:
        raise FlowFileError("a flow must have a surface line to move it, got none: add the line")
    return replace(flow, surface=moved(flow, surface, offset))


def moved(flow: Flow, surface: Surface, offset: float) -> Surface:
    """Points of the free surface of a flow, moved outwards by `offset`, in the unit of length."""
    n_x, n_y = outward_normals(flow, surface).T
    return replace(surface, x=surface.x + offset * n_x, y=surface.y + offset * n_y)


def outward_normals(flow: Flow, surface: Surface) -> Float64:
    """Unit normals (n_x, n_y) of the points of the line, away from the grains [n, 2]."""
    up = -np.asarray(flow.gravity) / np.hypot(*flow.gravity)
    line = np.stack([surface.x, surface.y], -1)
    found = np.empty(line.shape)
    frames, vectors = _vectors(flow)
    for t in np.unique(surface.t):
        now = surface.t == t
        points = line[now]
        normals = _normals(points, up)
        grains = vectors[int(np.argmin(np.abs(frames - t)))]
        away = np.broadcast_to(up, points.shape)
        if len(grains):
            near = cKDTree(grains).query(points, min(GRAINS, len(grains)))[1]
            away = points - grains[near.reshape(len(points), -1)].mean(axis=1)
        side = np.sign(np.sum(normals * away, axis=1))
        found[now] = normals * np.where(side == 0, 1.0, side)[:, None]
    return found


def _normals(points: Float64, up: Float64) -> Float64:
    """Directions of the least spread of the nearest points [n, 2]; `up` for too few points."""
    places, place = np.unique(points, axis=0, return_inverse=True)  # points may repeat
    if len(places) < 3:
        return np.broadcast_to(up, points.shape)
    near = places[cKDTree(places).query(places, min(ON_LINE, len(places)))[1]]
    around = near - near.mean(axis=1, keepdims=True)
    spread = np.einsum("nki,nkj->nij", around, around)
    return np.asarray(np.linalg.eigh(spread)[1][:, :, 0])[place]


def _vectors(flow: Flow) -> tuple[Float64, list[Float64]]:
    """Times [T], and the places of the vectors of each [k, 2]."""
    p = flow.particles
    if p is not None:
        order = np.argsort(p.t, kind="stable")
        times, first = np.unique(p.t[order], return_index=True)
        return times, np.split(np.stack([p.x, p.y], -1)[order], first[1:])
    frame, row, column = np.nonzero(flow.valid)
    ends = np.searchsorted(frame, np.arange(1, flow.t.size))
    return flow.t, np.split(np.stack([flow.x[column], flow.y[row]], -1), ends)
