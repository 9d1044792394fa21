"""Large flows on a grid: checked in slabs of frames, and used at fewer frames.

Of a flow of more than `MOST_CELLS` cells over all frames, every n-th frame is used, as if the
camera had been slower. A steady flow is the mean over all of its frames. Every eighth frame of the
demonstration gives the same law.
"""

from __future__ import annotations

import resource
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from granpinn.arrays import Bool, Index, nearest
from granpinn.data.flow import Flow, Particles, Surface

MOST_CELLS = 2**23
SLAB_CELLS = 2**20  # of a slab: its temporary arrays stay small
P = TypeVar("P", Surface, Particles)
GRID = ("u", "v", "c", "p", "sigma_u", "sigma_v")


def slabs(flow: Flow) -> list[slice]:
    """Frames one after another, in slabs of about `SLAB_CELLS` cells."""
    frames = max(1, SLAB_CELLS // flow.c[0].size)
    return [slice(a, b) for a, b in pairwise([*range(0, flow.t.size, frames), flow.t.size])]


def thinned(flow: Flow) -> Flow:
    """Every n-th frame of a flow of too many cells, at least two; any other flow as it is.

    Scattered vectors are used as they are.
    """
    n = min(-(-flow.c.size // MOST_CELLS), max(1, flow.t.size - 1))
    if flow.particles is not None or n == 1:
        return flow
    return replace(some_frames(flow, slice(None, None, n)), every=n)


def some_frames(flow: Flow, frames: slice | Index) -> Flow:
    """A flow of some frames with their points of the surface and all walls.

    Arrays of a slice stay where they are.
    """
    k = np.arange(flow.t.size)[frames]
    arrays = {name: getattr(flow, name) for name in GRID}
    kept: dict[str, Any] = {
        name: a[frames] for name, a in arrays.items() if isinstance(a, np.ndarray)
    }
    surface = flow.surface
    if surface is not None:
        surface = chosen(surface, np.isin(nearest(flow.t, surface.t), k))
    return replace(flow, t=flow.t[k], surface=surface, **kept)


def chosen(points: P, kept: Bool) -> P:
    """Some points of a surface, or some of the scattered vectors."""
    parts: dict[str, Any] = {n: None if a is None else a[kept] for n, a in vars(points).items()}
    return type(points)(**parts)


def available() -> int:
    """Bytes of memory that this process may still take: free ones, and what the kernel can give
    back, within the limit of the process."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    free = int(dict(line.split(":", 1) for line in lines)["MemAvailable"].split()[0]) * 1024
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft != resource.RLIM_INFINITY:
        free = min(free, soft - address_space())
    return max(free, 0)


def address_space() -> int:
    """Bytes of address space that this process has."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
