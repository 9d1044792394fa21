"""Large flows on a grid: read frame by frame, and represented by some of their frames.

A flow of at most `MOST_CELLS` cells over all frames is used as it is. Of a larger one

- checks and training points go over all frames, in slabs of some frames (`slabs`);
- fields, figures and errors are those of frames that are spread evenly (`spread`);
- noise, symmetries, the momentum balance and the inspection are those of runs of frames (`runs`),
  which are spread evenly too: differences in time need neighbors.

Each of these choices holds at most `MOST_CELLS` cells, or one run of larger frames.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from granpinn.arrays import Bool, Float64, Index, nearest
from granpinn.data.flow import Flow, Surface

MOST_CELLS = 2**23
SLAB_CELLS = 2**20  # of a slab: its temporary arrays stay small
RUN = 10  # frames: local fits take up to 9, the noise of vectors with gaps needs 9
# The times of frames, and the frame nearest to every point of a surface: slabs ask many times.
_nearest: WeakKeyDictionary[Surface, tuple[Float64, Index]] = WeakKeyDictionary()
GRID = ("u", "v", "c", "p", "sigma_u", "sigma_v")


def is_large(flow: Flow) -> bool:
    """Whether the flow has more cells than are used at once. Scattered vectors never are large."""
    return flow.particles is None and flow.c.size > MOST_CELLS


def slabs(flow: Flow) -> list[slice]:
    """Frames one after another, all in one slab unless the flow is large; never one frame alone."""
    T = flow.t.size
    if not is_large(flow) or T == 1:
        return [slice(0, T)]
    frames = max(2, SLAB_CELLS // flow.c[0].size)
    edges = [*range(0, T - 1, frames), T]
    return [slice(a, b) for a, b in pairwise(edges)]


def most_cells(flow: Flow) -> int:
    """Cells of the frames that stand for a large flow, at most."""
    return max(MOST_CELLS, min(RUN, flow.t.size) * flow.y.size * flow.x.size)


def some_frames(flow: Flow, frames: slice | Index) -> Flow:
    """A flow of some frames with their points of the surface and all walls; the flow itself if
    these are all frames. Arrays of a slice stay where they are."""
    k = np.arange(flow.t.size)[frames]
    if k.size == flow.t.size:
        return flow
    arrays = {name: getattr(flow, name) for name in GRID}
    kept: dict[str, Any] = {
        name: a[frames] for name, a in arrays.items() if isinstance(a, np.ndarray)
    }
    surface = None if flow.surface is None else of_frames(flow.surface, flow.t, k)
    return replace(flow, t=flow.t[k], surface=surface, **kept)


def of_frames(surface: Surface, t: Float64, frames: Index) -> Surface:
    """The points that are nearest in time to some of the frames at t [T] (`surface.py`)."""
    wanted = np.zeros(t.size, bool)
    wanted[frames] = True
    known, frame = _nearest.get(surface, (None, None))
    if known is not t or frame is None:
        frame = nearest(t, surface.t)
        _nearest[surface] = t, frame
    return chosen(surface, wanted[frame])


def chosen(surface: Surface, kept: Bool) -> Surface:
    """Some points of a surface."""
    parts = {name: None if a is None else a[kept] for name, a in vars(surface).items()}
    return Surface(**parts)  # type: ignore[arg-type]


def spread(flow: Flow) -> Flow:
    """Frames from the first to the last at even distances; the flow itself unless it is large."""
    if not is_large(flow):
        return flow
    count = max(2, MOST_CELLS // flow.c[0].size)
    return some_frames(flow, _evenly(flow.t.size - 1, count))


def runs(flow: Flow) -> Flow:
    """Runs of frames at even distances, with their `starts`; the flow itself unless it is large."""
    T = flow.t.size
    if not is_large(flow):
        return flow
    length = min(RUN, T)
    count = min(max(1, MOST_CELLS // (flow.c[0].size * length)), T // length)
    first = _evenly(T - length, count)
    frames = (first[:, None] + np.arange(length)).ravel()
    starts = tuple(range(0, len(frames), length))
    return replace(some_frames(flow, frames), starts=starts)


def _evenly(last: int, count: int) -> Index:
    """At most `count` whole numbers from 0 to `last`; the middle if it is one."""
    if count == 1:
        return np.array([last // 2])
    return np.unique(np.linspace(0, last, count).round().astype(np.intp))
