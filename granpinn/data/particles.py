"""Scattered velocity vectors, one per tracked grain and time: the particle layout of a flow file.

Training takes the vectors as they are. Figures and maps need a grid, so a flow of particles also
has a view on a grid: cells that hold grains, and the mean velocity of the grains in a cell.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy

from granpinn.arrays import Bool, Float32, Float64, Floats, Index, nearest
from granpinn.data.flow import Flow, FlowFileError, Particles
from granpinn.data.schema import arrays_in, check_layout, check_ranges
from granpinn.declared import checked

# A cell is this many times wider than the usual distance to the nearest grain.
CELL = 2.5
MAX_FRAMES = 1000
MAX_CELLS = 20_000_000  # of the view, over all frames
MAX_AXIS = 400
_SAMPLED_FRAMES = 5


@checked
def particle_flow(particles: Particles, **others: Any) -> Flow:
    """A flow of scattered vectors.

    Args:
        particles: time, position and velocity of every vector.
        others: the remaining fields of Flow, such as gravity, density and grain_diameter.
    """
    return Flow(**grid_view(particles), particles=particles, **others)


def grid_view(particles: Particles) -> dict[str, Any]:
    """The particles on a regular grid around them, with c = 1 in the cells that hold grains.

    Returns:
        The fields t, y, x, u, v, c of a Flow.

    Raises:
        FlowFileError: the vectors do not span a time and an area.
    """
    arrays = arrays_in(particles)
    check_layout(arrays)
    check_ranges(arrays)
    t = np.unique(particles.t)
    if t.size > MAX_FRAMES:
        t = np.linspace(t[0], t[-1], MAX_FRAMES)
    # A pause of the measurement has no frames, whatever their number.
    frame = nearest(t, particles.t)
    seen, frame = np.unique(frame, return_inverse=True)
    t = t[seen]
    cell = _cell_size(particles, frame, t.size)
    x, column = _axis("x", particles.x, cell)
    y, row = _axis("y", particles.y, cell)
    shape = (t.size, y.size, x.size)
    place = np.ravel_multi_index((frame, row, column), shape)
    count = np.bincount(place, minlength=math.prod(shape))

    def means(values: Floats) -> Float32:
        sums = np.bincount(place, weights=values, minlength=count.size)
        mean = np.divide(sums, count, out=np.full(count.size, np.nan), where=count > 0)
        return np.asarray(mean.reshape(shape), np.float32)

    c = np.stack([closed(frame > 0) for frame in count.reshape(shape)]).astype(np.float32)
    return {"t": t, "y": y, "x": x, "u": means(particles.u), "v": means(particles.v), "c": c}


def closed(occupied: Bool) -> Bool:
    """Cells [Y, X] that hold grains: those with vectors, and gaps of up to two cells."""
    grown = scipy.ndimage.binary_closing(np.pad(occupied, 3), structure=np.ones((3, 3), bool))
    return np.asarray(grown[3:-3, 3:-3] | occupied)


def _cell_size(particles: Particles, frame: Index, n_frames: int) -> float:
    """Width of the cells, from the distance between neighbors in a few frames."""
    distances = []
    for k in np.unique(np.linspace(0, n_frames - 1, _SAMPLED_FRAMES).astype(int)):
        points = np.unique(np.stack([particles.x, particles.y], -1)[frame == k], axis=0)
        if len(points) > 1:
            distances.append(scipy.spatial.cKDTree(points).query(points, k=2)[0][:, 1])
    found = np.concatenate(distances) if distances else np.empty(0)
    width, height = (float(np.ptp(a)) for a in (particles.x, particles.y))
    if found.size == 0 or not width > 0 or not height > 0:
        raise FlowFileError(
            "particles must be spread over an area, got vectors in one place or on one line: "
            "check particles/x and particles/y"
        )
    least = max(max(width, height) / MAX_AXIS, math.sqrt(width * height * n_frames / MAX_CELLS))
    return max(CELL * float(np.median(found)), least)


def _axis(name: str, values: Float64, cell: float) -> tuple[Float64, Index]:
    """Cell centers around the values, and the cell of each value."""
    low = float(values.min())
    count = max(2, math.ceil((float(values.max()) - low) / cell + 1e-9))
    centers = np.asarray(low + cell * (np.arange(count) + 0.5), np.float64)
    if not (np.diff(centers) > 0).all():
        raise FlowFileError(
            f"particles/{name} must vary by more than its rounding, got {low:g} and less than "
            f"{cell:g} around it: move the origin of the coordinates to the grains"
        )
    index = np.clip(((values - low) / cell).astype(np.intp), 0, count - 1)
    return centers, index
