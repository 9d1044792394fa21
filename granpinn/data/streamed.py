"""The training set of a large flow, made slab by slab (`large.py`).

At most `MOST_VECTORS` vectors train: a random part of every slab, the same in each, and the same
for every seed. Points between the vectors, in the strip under the surface and on walls are as many
for each vector that trains as in other flows. Those in the strip and on walls are taken at some of
the frames, as many as the part of the vectors says; the points of the free surface, at all.

So a training set takes at most `MOST_BYTES`, however large the flow is. It holds more points than
the default training draws, 2.6e7 of vectors and between them: a larger part would change little.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from granpinn.arrays import Float64
from granpinn.data.collocation import lowest_row, points_between, without_row
from granpinn.data.flow import Flow, FlowFileError, FlowFileWarning, Surface
from granpinn.data.large import chosen, of_frames, slabs, some_frames
from granpinn.data.noise import variance, velocity_weights
from granpinn.data.outline import highest_rows, outline_above
from granpinn.data.partial_cells import with_partial_cells
from granpinn.data.points import (
    TrainingSet,
    place_of,
    pressure_on,
    samples_of,
    surface_of,
    training_set,
    turned_and_rounded,
    usable,
)
from granpinn.data.row_block import Rows
from granpinn.data.source import source_at
from granpinn.data.surface_line import SAME_TIME
from granpinn.data.surface_strip import Strip, draw, strip_of, with_even_weights
from granpinn.data.symmetry import axes_of
from granpinn.data.wall_points import walls_of, warn_of_contradictions, with_walls
from granpinn.physics.axes import vertical_coordinate

if TYPE_CHECKING:
    from granpinn.physics.scales import Scales

MOST_VECTORS = 2**24
# With as many points between the vectors: 28 bytes for a vector, 16 for a point between, and 28 for
# each once they are pooled.
MOST_BYTES = 100 * MOST_VECTORS
_KEY = 5 << 64  # of Philox; the same vectors for every seed
_NONE = Surface(t=np.empty(0), x=np.empty(0), y=np.empty(0))


def vector_counts(flow: Flow) -> tuple[int, int]:
    """Vectors after the start in cells full of grains, and in cells with any grains."""
    full, some = 0, 0
    for k in slabs(flow):
        there = np.isfinite(flow.u[k]) & flow.after_start(flow.t[k])[:, None, None]
        full += int((there & (flow.c[k] >= 1)).sum())
        some += int((there & (flow.c[k] > 0)).sum())
    return full, some


def streamed_set(
    flow: Flow,
    seen: Flow,
    scales: Scales,
    level: str,
    collocation: float,
    dtype: torch.dtype,
) -> TrainingSet:
    """The points of a fit of a large flow, as `variants.training_sets` makes those of others.

    Args:
        flow: without reference pressure.
        seen: runs of it, with its partly filled cells.
        collocation: points between the vectors for each vector.

    Raises:
        FlowFileError: the flow lacks data that the level needs.
    """
    made = _Streamed(flow, seen, scales, level, collocation, dtype)
    for frames, own in _filled(flow):
        made.add_vectors(frames, own)
        made.add_edges(frames, own)
    facts = walls_of(seen)
    if facts is not None:
        warn_of_contradictions(facts[2])
    return made.joined()


def _filled(flow: Flow) -> Iterator[tuple[slice, Flow]]:
    """Slabs of frames, with one frame more up to which cells reach, and partly filled cells."""
    for k in slabs(flow):
        own = some_frames(flow, slice(k.start, min(k.stop + 1, flow.t.size)))
        yield k, with_partial_cells(own)


def _surface(flow: Flow, level: str) -> Surface:
    """The points of the free surface of a level."""
    if level != "V0":
        return surface_of(flow, level)
    rows = [highest_rows(with_partial_cells(some_frames(flow, k))) for k in slabs(flow)]
    return usable(outline_above(np.concatenate(rows), flow), flow, level)


class _Streamed:
    """The points that were made of a flow so far.

    Attributes:
        part: of the vectors that train.
        every: strips and walls are those of every so-many-th frame.
        row: the lowest row of grains.
    """

    def __init__(
        self,
        flow: Flow,
        seen: Flow,
        scales: Scales,
        level: str,
        collocation: float,
        dtype: torch.dtype,
    ) -> None:
        self.flow, self.scales, self.level, self.dtype = flow, scales, level, dtype
        self.collocation = collocation
        full, some = vector_counts(flow)
        self.part = min(1.0, MOST_VECTORS / max(1, full))
        self.every = int(1 / self.part)
        self.row = self._lowest(seen)
        self.surface = _surface(flow, level)
        self.edges = np.zeros(flow.t.size, bool)
        self.edges[np.flatnonzero(flow.after_start(flow.t))[:: self.every]] = True
        most = math.ceil(self.part * some) + len(slabs(flow))
        self.points, self.velocity, self.weights = (Rows(most, k, dtype) for k in (3, 2, 2))
        self.between = Rows(round(collocation * most) + len(slabs(flow)), 3, dtype)
        self.variances: list[Float64] = []
        self.bounds: list[tuple[torch.Tensor, torch.Tensor]] = []
        self.strips: list[Strip] = []
        self.walls: list[TrainingSet] = []

    def add_vectors(self, frames: slice, own: Flow) -> None:
        """Add vectors of a slab of frames, and points between them up to the frame behind it."""
        count, later = frames.stop - frames.start, own.after_start(own.t)[:, None, None]
        taken = own.valid_in(slice(0, count)) & later[:count]
        there = np.flatnonzero(taken)
        wanted = min(there.size, math.ceil(self.part * there.size))
        if wanted == 0:
            return
        rng = np.random.Generator(np.random.Philox(key=_KEY + frames.start))
        taken[:] = False
        taken.ravel()[rng.choice(there, wanted, replace=False, shuffle=False)] = True
        vectors = some_frames(replace(own, surface=None), slice(0, count))
        vectors = replace(vectors, u=np.where(taken, vectors.u, np.nan))
        made = training_set(vectors, self.scales, "V1", self.dtype, _NONE)
        self.points.add(made.points)
        self.velocity.add(made.velocity)
        self.weights.add(made.point_weights)
        self.bounds.append((made.lower, made.upper))
        if isinstance(own.sigma_u, np.ndarray) or isinstance(own.sigma_v, np.ndarray):
            samples = samples_of(vectors)
            assert samples.sigma_u is not None
            assert samples.sigma_v is not None
            self.variances.append(variance(samples.sigma_u, samples.sigma_v))
        above = without_row(own.material & later, own.gravity, self._lower(self._lowest(own)))
        x, y, t = points_between(own, above, round(self.collocation * wanted), frames.start)
        self.between.add(self._tensor(self._placed(x, y, t)))

    def add_edges(self, frames: slice, own: Flow) -> None:
        """Add the strips under the surface and the points of walls at some frames of a slab."""
        for k in np.flatnonzero(self.edges[frames]):
            frame = some_frames(own, slice(k, k + 1))
            if not frame.valid.any():
                continue
            line = of_frames(self.surface, self.flow.t, np.array([frames.start + k]))
            same = np.isclose(line.t, frame.t[0], rtol=SAME_TIME, atol=SAME_TIME * self.scales.time)
            line = chosen(line, same)
            full = training_set(frame, self.scales, "V1", self.dtype, line)
            if self.level != "V0" and line.t.size:
                self.strips.append(strip_of(full, frame, self.scales))
            if frame.walls is not None:
                empty = full.surface_points[:0]
                bare = replace(full, surface_points=empty, surface_pressure=empty[:, 0])
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", FlowFileWarning)  # see `streamed_set`
                    self.walls.append(with_walls(bare, frame, self.scales))

    def joined(self) -> TrainingSet:
        """One set of all points."""
        if not self.bounds:
            raise FlowFileError(
                "c, u and v must hold valid vectors where c = 1 at t > 0, got none: start the "
                "clock at the release of the grains"
            )
        points, velocity, between = self.points.all, self.velocity.all, self.between.all
        weights, (lower, upper) = self.weights.all, zip(*self.bounds, strict=True)
        if self.variances:
            weights[:, 0] = self._tensor(velocity_weights(np.concatenate(self.variances)))
        strip, weight = self._strip(between, len(points))
        equation_weights = torch.ones(len(between) + len(strip), dtype=self.dtype)
        equation_weights[len(between) :] = weight
        line = place_of(self.surface, self.flow, self.scales)
        pressure = pressure_on(self.surface, self.scales, self.level)
        made = TrainingSet(
            points,
            velocity,
            weights,
            self._tensor(line),
            self._tensor(pressure),
            lower=torch.stack(lower).amin(0),
            upper=torch.stack(upper).amax(0),
            between=between,
            strip=strip,
            equation_weights=equation_weights,
            wall_points=points[:0],
            wall_velocity=velocity[:0],
        )
        made = self._with_walls(with_even_weights(made))
        of_equations = [made.points, between, strip] if self.flow.source else [between[:0]]
        return replace(made, source=source_at(torch.cat(of_equations), self.flow, self.scales))

    def _strip(self, between: torch.Tensor, vectors: int) -> tuple[torch.Tensor, float]:
        """Points in the strips of the chosen frames, as many as in all strips for each vector, and
        the weight of each.
        """
        if not self.strips or len(between) == 0:
            return between[:0], 1.0
        surface, nearest, area = (
            np.concatenate([strip[k] for strip in self.strips]) for k in range(3)
        )
        whole = Strip(surface, nearest, self.part * self.every * area, between)
        drawn = draw([whole], len(between), vectors)
        return (between[:0], 1.0) if drawn is None else (whole.points(drawn), drawn.weight)

    def _with_walls(self, made: TrainingSet) -> TrainingSet:
        """The set with the walls at the chosen frames, and their known pressures."""
        if not self.walls:
            return made
        rng = np.random.Generator(np.random.Philox(key=_KEY - 1))

        def some(share: float, *tensors: torch.Tensor) -> list[torch.Tensor]:
            n = len(tensors[0])
            kept = torch.as_tensor(rng.choice(n, round(share * n), replace=False, shuffle=False))
            return [tensor[kept] for tensor in tensors]

        names = ("wall_points", "wall_velocity", "surface_points", "surface_pressure")
        at, velocity, pressed, pressure = (
            torch.cat([getattr(part, name) for part in self.walls]) for name in names
        )
        line = [made.surface_points, made.surface_pressure]
        if len(pressed):  # as many of the line for each of them as in all frames
            line = some(1 / self.every, *line)
        at, velocity = some(self.part * self.every, at, velocity)
        return replace(
            made,
            wall_points=at,
            wall_velocity=velocity,
            surface_points=torch.cat([line[0], pressed]),
            surface_pressure=torch.cat([line[1], pressure]),
        )

    def _lowest(self, flow: Flow) -> int | None:
        grains = flow.material & flow.after_start(flow.t)[:, None, None]
        return lowest_row(grains, flow.gravity)

    def _lower(self, row: int | None) -> int | None:
        """The lower of a row of a slab and that of the flow."""
        lower = max if vertical_coordinate(self.flow.gravity)[1] else min
        rows = [k for k in (row, self.row) if k is not None]
        return lower(rows) if rows else None

    def _placed(self, x: Float64, y: Float64, t: Float64) -> Float64:
        points = self.scales.points_to_dimensionless(x, y, t)
        return turned_and_rounded(points, axes_of(self.flow))

    def _tensor(self, values: Float64) -> torch.Tensor:
        return torch.as_tensor(values).to(self.dtype)
