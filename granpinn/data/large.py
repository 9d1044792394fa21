"""Large flows on a grid: read frame by frame, and represented by some of their frames.

A flow of at most `MOST_CELLS` cells over all frames is used as it is. Of a larger one

- checks and training points go over all frames, in slabs of some frames (`slabs`, `streamed.py`);
- fields, figures and errors are those of frames that are spread evenly (`spread`);
- noise, symmetries and the momentum balance are those of runs of frames (`runs`), which are spread
  evenly too: differences in time need neighbors.

Both choices hold at most `MOST_CELLS` cells.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from granpinn.arrays import Index
from granpinn.data.flow import Flow, Surface

MOST_CELLS = 2**23
SLAB_CELLS = 2**20  # of a slab: its temporary arrays stay small
RUN = 10  # frames: local fits take up to 9, the noise of vectors with gaps needs 9
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


def some_frames(flow: Flow, frames: slice | Index) -> Flow:
    """A flow of some frames, in memory, with their points of the surface and all walls."""
    k = np.arange(flow.t.size)[frames]
    arrays = {name: getattr(flow, name) for name in GRID}
    kept = {name: np.array(a[frames]) for name, a in arrays.items() if isinstance(a, np.ndarray)}
    return replace(flow, t=flow.t[k], surface=_of_frames(flow, k), **kept)


def _of_frames(flow: Flow, frames: Index) -> Surface | None:
    """The points of the surface that are nearest in time to some frames (`surface_line.py`)."""
    surface = flow.surface
    if surface is None:
        return None
    wanted = np.zeros(flow.t.size, bool)
    wanted[frames] = True
    kept = wanted[np.searchsorted((flow.t[1:] + flow.t[:-1]) / 2, surface.t)]
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
    if not is_large(flow) or T <= RUN:
        return flow if not is_large(flow) else some_frames(flow, slice(0, T))
    count = min(max(1, MOST_CELLS // (flow.c[0].size * RUN)), T // RUN)
    first = _evenly(T - RUN, count)
    frames = (first[:, None] + np.arange(RUN)).ravel()
    starts = tuple(range(RUN, count * RUN, RUN))
    return replace(some_frames(flow, frames), starts=starts)


def _evenly(last: int, count: int) -> Index:
    """At most `count` whole numbers from 0 to `last`; the middle if it is one."""
    if count == 1:
        return np.array([last // 2])
    return np.unique(np.linspace(0, last, count).round().astype(np.intp))
